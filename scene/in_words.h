#pragma once

#include <optional>
#include <string>
#include <vector>

#include "scene/material_change.h"
#include "scene/room_light.h"

namespace limn::scene {

/// Names in a row, "a, b"; "none" when there are none.
std::string listed(const std::vector<std::string>& names);

/// The words that material_change_of() takes: colours to a level of 255, shares to 0.001. Empty: no change.
std::string words_of(const MaterialChange& change);

/// The numbers that room_light_of() takes, with the same front: degrees to 0.1, light to 0.001.
/// nullopt: it cannot say this light (coloured, or other than one lamp).
std::optional<LightNumbers> numbers_of(const RoomLight& light, const Eigen::Vector3d& d_front_world);

}  // namespace limn::scene
