#pragma once

#include <numbers>

#include "sim/world.h"

namespace limn::test {

/// The pose of an upright sheet (z up) that faces -y: its x is the world's x, its z is the world's +y.
inline Pose facing_minus_y(double x, double y, double z) {
  return Pose(Eigen::Quaterniond(Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitX())),
              {x, y, z});
}

/// A white wall at y = `wall_y`, a camera at the origin (320 x 240), and beside it a projector with lens
/// distortion (200 x 150); both face +y. No effects, no room light.
inline sim::World small_world(double wall_y = 1.0) {
  sim::World world;
  const Pose camera_from_world = looking_at({0, 0, 0}, {0, 1, 0}, Eigen::Vector3d::UnitZ());
  const Pose projector_from_world = looking_at({0.3, 0, 0.1}, {0, 1, 0}, Eigen::Vector3d::UnitZ());
  world.rig.cameras = {{"camera0", 320, 240, Lens::pinhole(400, 400, 159.5, 119.5), camera_from_world}};
  world.rig.projectors = {
      {"projector0", 200, 150,
       Lens::create("LENSMODEL_OPENCV4", {220, 221, 98, 110, -0.05, 0.01, 1e-4, 2e-4}).value(),
       projector_from_world}};
  world.camera_effects.resize(1);
  world.projector_effects.resize(1);
  world.objects = {sim::sheet("wall", 4, 4, {}, facing_minus_y(0, wall_y, 0))};
  world.objects[0].albedo.setConstant(1);
  return world;
}

}  // namespace limn::test
