#pragma once

#include <Eigen/Core>
#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/result.h"

namespace limn::scene {

/// The room's light that parts are shaded by, linear: a hemisphere of soft light and lamps far away.
struct RoomLight {
  struct Lamp {
    Eigen::Vector3d d_world = Eigen::Vector3d::UnitZ();           ///< unit, towards the lamp
    Eigen::Vector3d strength_rgb = Eigen::Vector3d::Constant(1);  ///< light of a white surface that faces it
    bool operator==(const Lamp&) const = default;
  };
  static constexpr std::size_t k_most_lamps = 4;
  Eigen::Vector3d d_up_world = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d below_rgb =
      Eigen::Vector3d::Zero();  ///< light of a white surface that faces down, without lamps
  Eigen::Vector3d above_rgb = Eigen::Vector3d::Zero();  ///< up
  std::vector<Lamp> lamps;
  bool operator==(const RoomLight&) const = default;
};

/// `light` of scene.json and of a look. Problems are noted at the node.
RoomLight read_room_light(const ConfigNode& node);
/// The same back, numbers in full.
nlohmann::ordered_json to_json(const RoomLight& light);

/// White light in five numbers: a lamp's degrees to the right and up as seen by somebody who stands in front,
/// its strength, and soft light from above and below.
using LightNumbers = std::array<double, 5>;
/// Those of a text, "30 45 0.6 0.3 0.1". Error: other than five numbers, degrees over 360, light that is
/// negative or over 10.
Result<LightNumbers> light_numbers_of(const std::string& words);
/// The light of such numbers. Of `d_front_world` what is level counts.
RoomLight parse_room_light(const LightNumbers& numbers,
                           const Eigen::Vector3d& d_up_world,
                           const Eigen::Vector3d& d_front_world);

}  // namespace limn::scene
