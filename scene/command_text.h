#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scene/material_override.h"
#include "scene/room_light.h"

namespace limn::scene {

/// Names in a row, "a, b"; "none" when there are none.
std::string listed(const std::vector<std::string>& names);

/// The words that parse_material_override() takes: colours to a level of 255, shares to 0.001. Empty: no
/// change.
std::string format_material_override(const MaterialOverride& change);

/// The numbers that parse_room_light() takes, with the same front: degrees to 0.1, light to 0.001.
/// nullopt: it cannot say this light (coloured, or other than one lamp).
std::optional<LightNumbers> room_light_numbers(const RoomLight& light, const Eigen::Vector3d& d_front_world);

}  // namespace limn::scene
