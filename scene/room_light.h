#pragma once

#include <Eigen/Core>
#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/result.h"

namespace limn::scene {

/// The light that parts are shaded by: soft light from a hemisphere and distant lamps. Strengths are linear.
struct RoomLight {
  struct Lamp {
    Eigen::Vector3d d_world = Eigen::Vector3d::UnitZ();           ///< Unit direction towards the lamp.
    Eigen::Vector3d strength_rgb = Eigen::Vector3d::Constant(1);  ///< Light of a white surface that faces it.
    bool operator==(const Lamp&) const = default;
  };
  static constexpr std::size_t k_most_lamps = 4;
  Eigen::Vector3d d_up_world = Eigen::Vector3d::UnitZ();
  /// Soft light of a white surface that faces down or up, without lamps.
  Eigen::Vector3d below_rgb = Eigen::Vector3d::Zero();
  Eigen::Vector3d above_rgb = Eigen::Vector3d::Zero();
  std::vector<Lamp> lamps;
  double image_strength = 0;  ///< Factor on the light of the scene's picture of the room; 0: it is not used.
  bool operator==(const RoomLight&) const = default;
};

/// Reads `light` of scene.json or of a look file. Problems are recorded at the node. `may_have_image`: it may
/// have `image` (scene/room_image.h), and then the image's strength is 1 if it is absent.
RoomLight read_room_light(const ConfigNode& node, bool may_have_image = false);
/// The light as JSON for read_room_light(), with full precision.
nlohmann::ordered_json to_json(const RoomLight& light);

/// White light as five numbers: a lamp's degrees to the right and up, as seen by somebody who stands in
/// front, its strength, and soft light from above and below.
using LightNumbers = std::array<double, 5>;
/// Reads text such as "30 45 0.6 0.3 0.1". Error: not five numbers, degrees over 360, light that is negative
/// or over 10.
Result<LightNumbers> light_numbers_of(const std::string& words);
/// The light of such numbers. Only the horizontal part of `d_front_world` counts.
RoomLight parse_room_light(const LightNumbers& numbers,
                           const Eigen::Vector3d& d_up_world,
                           const Eigen::Vector3d& d_front_world);

}  // namespace limn::scene
