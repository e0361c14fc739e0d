#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/marker.h"
#include "core/result.h"

namespace limn::scene {

/// Where markers stand on a rigid thing, as a file says: limn.body/1 (`limn markers --learn-body`, in the
/// frame of one of them) or limn.markers/1 (`limn align --body`, in the prototype's). Errors name the file
/// and the key; a marker that is there twice is one.
Result<std::vector<BodyMarker>> load_marker_file(const std::filesystem::path& path);

/// limn.markers/1 as text.
std::string marker_file_json(std::span<const BodyMarker> markers);

}  // namespace limn::scene
