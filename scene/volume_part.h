#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "core/config.h"
#include "core/result.h"
#include "scene/meshes/mesh.h"
#include "scene/scene.h"
#include "scene/volumes/volume.h"

namespace limn::scene {

/// The box around a volume's voxels, in the part's frame: what the part shows where no plane cuts it. It is
/// dark, so that the slice is what is seen.
Mesh volume_box(const Volume& volume);

/// How a part's volume is shown: the chosen window, else the one that the scene states, else the file's.
GreyWindow shown_window(const Variant& variant, const std::optional<GreyWindow>& chosen);

/// Reads text such as "400 40": width and level; empty text is no window. Error: other words, a width that
/// is not above 0.
Result<std::optional<GreyWindow>> parse_grey_window(const std::string& words);
/// The window as text for parse_grey_window(), with six digits. Empty for no window.
std::string format_grey_window(const std::optional<GreyWindow>& window);

/// Reads `window` of a scene or look file: {"width": 400, "level": 40}. Problems are recorded at the node.
GreyWindow read_grey_window(const ConfigNode& node);
nlohmann::ordered_json to_json(const GreyWindow& window);

/// Whether the numbers make a window: finite, and a width above 0.
bool is_window(const GreyWindow& window);

}  // namespace limn::scene
