#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "calib/surface/surface_samples.h"
#include "core/pose.h"
#include "scene/meshes/mesh.h"
#include "scene/meshes/scan_surface.h"
#include "sim/world.h"

/// The door of the example scene with clay that was added or taken away: the truth of deviations.
namespace limn::test {

// Clay that was added to the door's outer side or taken from it (m, the door's frame).
struct DoorBump {
  double x = 0, y = 0, radius = 0, height = 0;
};
inline constexpr DoorBump k_door_bumps[] = {{-0.20, -0.09, 0.030, 0.3e-3},  {-0.11, 0.03, 0.030, 1e-3},
                                            {0.12, -0.09, 0.035, 3e-3},     {0.20, -0.05, 0.025, -0.6e-3},
                                            {-0.05, -0.12, 0.030, -1.5e-3}, {0.05, 0.00, 0.035, -3e-3}};

inline double door_height(const Eigen::Vector3d& p) {
  double sum = 0;
  for (const DoorBump& b : k_door_bumps) {
    const double share = 1 - (Eigen::Vector2d(b.x, b.y) - p.head<2>()).squaredNorm() / (b.radius * b.radius);
    if (share > 0) sum += b.height * share * share;
  }
  return sum;
}

// The door with its bumps, finely divided, so that it has their shape.
inline scene::Mesh bumped(const scene::Mesh& door) {
  scene::Mesh mesh = door;
  const scene::ScanSurface fine = calib::surface_samples(door, 2.5e-3, 2'000'000).surface;
  mesh.positions = fine.positions;
  mesh.triangles = fine.triangles;
  mesh.uvs.clear();
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  for (std::size_t i = 0; i < fine.positions.size(); ++i)
    if (fine.normals[i].z() > 0.3f)
      mesh.positions[i] +=
          static_cast<float>(door_height(fine.positions[i].cast<double>())) * fine.normals[i];
  scene::ScanSurface surface;
  surface.positions = mesh.positions;
  surface.triangles = mesh.triangles;
  mesh.normals = scene::normals_from_triangles(surface);
  return mesh;
}

// A hand: a palm 50 mm in front of the door and a finger that touches it, as boxes of a mesh (world frame).
inline sim::Object box_object(const std::string& name,
                              const Pose& world_from_box,
                              const Eigen::Vector3d& half) {
  scene::Mesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      const Eigen::Vector3d n = side * Eigen::Vector3d::Unit(axis), u = Eigen::Vector3d::Unit((axis + 1) % 3),
                            v = n.cross(u);
      for (const auto& [a, b] : {std::pair{-1, -1}, std::pair{1, -1}, std::pair{1, 1}, std::pair{-1, 1}}) {
        mesh.positions.push_back((n + a * u + b * v).cwiseProduct(half).cast<float>());
        mesh.normals.push_back(n.cast<float>());
      }
      mesh.triangles.push_back({first, first + 1, first + 2});
      mesh.triangles.push_back({first, first + 2, first + 3});
    }
  mesh.triangle_materials.assign(mesh.triangles.size(), 0);
  sim::Object object;
  object.name = name;
  object.mesh = std::make_shared<const scene::Mesh>(std::move(mesh));
  object.world_from_object = world_from_box;
  object.albedo = {0.35, 0.45, 0.6};
  return object;
}

}  // namespace limn::test
