#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scene/material_override.h"
#include "scene/room_light.h"

namespace limn::scene {

/// The names as a list, "a, b"; "none" for an empty list.
std::string listed(const std::vector<std::string>& names);

/// The change as text for parse_material_override(): colours in levels of 255, the other values rounded to
/// 0.001. Empty for no change.
std::string format_material_override(const MaterialOverride& change);

/// The light as numbers for parse_room_light() with the same front: degrees rounded to 0.1, light to 0.001.
/// Nullopt when such numbers cannot express it (coloured light, or not exactly one lamp).
std::optional<LightNumbers> room_light_numbers(const RoomLight& light, const Eigen::Vector3d& d_front_world);

}  // namespace limn::scene
