#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/marker.h"
#include "core/result.h"

namespace limn::scene {

/// Reads the poses of a body's markers: limn.body/1 (from `limn markers --learn-body`, in the frame of one of
/// the markers) or limn.markers/1 (from `limn align --body`, in the prototype's frame). Errors name the file
/// and the key; a marker that is listed twice is an error.
Result<std::vector<BodyMarker>> load_marker_file(const std::filesystem::path& path);

/// The text of a limn.markers/1 file.
std::string marker_file_json(std::span<const BodyMarker> markers);

}  // namespace limn::scene
