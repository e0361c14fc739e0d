#include "session/virtual_room.h"

#include <Eigen/Dense>
#include <algorithm>
#include <numbers>

#include "core/linear_algebra.h"
#include "scene/meshes/mesh_bvh.h"
#include "tracker/marker_image.h"

namespace limn::session {
namespace {

// The tilt of a marker is poorly measured when it is seen frontally, so the prototype is tilted.
constexpr double k_tilt_rad = 15 * std::numbers::pi / 180;
// Share of camera 0's width that the prototype fills if nothing else determines its distance.
constexpr double k_fill = 0.6;
constexpr double k_spacing = 2.2;  // distance between slots' markers, in their sides
constexpr double k_control_size_m = 0.04;
constexpr double k_paper_m = 0.0005;  // height of the paper above the prototype

Eigen::AlignedBox3d bounds(const scene::Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3f& p : mesh.positions) box.extend(p.cast<double>());
  return box;
}

// The mean of the markers' orientations: the direction in which the prototype faces.
Eigen::Quaterniond prototype_from_face(const scene::Prototype& prototype) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const BodyMarker& marker : prototype.markers) sum += marker.body_from_marker.rotation_matrix();
  if (prototype.markers.empty()) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(nearest_rotation(sum));
}

// The point nearest to all optical axes. If they are nearly parallel or meet behind camera 0, a point on
// camera 0's axis at which the prototype fills its image.
Eigen::Vector3d middle_of_sight(const Rig& rig, double prototype_size_m) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  const auto add = [&](const Imager& imager) {
    const Pose world_from_imager = imager.imager_from_world.inverse();
    const auto middle = imager.lens.unproject({0.5 * (imager.width - 1), 0.5 * (imager.height - 1)});
    if (!middle) return;
    const Eigen::Vector3d d = (world_from_imager.rotation * *middle).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    a += across;
    b += across * world_from_imager.translation;
  };
  for (const Imager& camera : rig.cameras) add(camera);
  for (const Imager& projector : rig.projectors) add(projector);
  const Imager& camera = rig.cameras[0];
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(a);
  if (eigen.eigenvalues()(0) > 1e-3) {
    const Eigen::Vector3d p = a.ldlt().solve(b);
    if ((camera.imager_from_world * p).z() > 0.2 * prototype_size_m) return p;
  }
  const double depth = prototype_size_m * camera.lens.fx() / (k_fill * camera.width);
  return camera.imager_from_world.inverse() * Eigen::Vector3d(0, 0, depth);
}

// How far the balls reach in the direction of z.
double depth_of(const Constellation& balls) {
  double depth = 0;
  for (const Eigen::Vector3d& p : balls.p_balls) depth = std::max(depth, p.z() + balls.radius_m);
  return depth;
}

// Poses for the slots' markers on the mesh, from its middle outwards, without overlap.
std::vector<BodyMarker> slot_markers(const scene::Scene& scene,
                                     const Eigen::Quaterniond& prototype_from_face) {
  const scene::Prototype& prototype = *scene.prototype;
  const Eigen::AlignedBox3d box = bounds(prototype.mesh);
  const double front = 0.5 * box.sizes().minCoeff();
  std::vector<BodyMarker> all = prototype.markers, placed;
  for (const scene::Slot& slot : scene.slots) {
    const double size_m = slot.constellation ? 2 * reach_of(*slot.constellation) : slot.size_m;
    const double height_m = slot.constellation ? depth_of(*slot.constellation) : k_paper_m;
    for (int step = 0; step < 400; ++step) {  // outwards on a spiral
      const double turn = 2.4 * step, radius = 0.5 * size_m * std::sqrt(step);
      const Eigen::Vector3d in_face(radius * std::cos(turn), radius * std::sin(turn), -front);
      const scene::MeshPoint on =
          scene::nearest_on(prototype.mesh, box.center() + prototype_from_face * in_face);
      const Eigen::Vector3d d_face = prototype_from_face * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d d_in = on.d_normal.dot(d_face) > 0 ? on.d_normal : -on.d_normal;
      const Pose at(rotation_between(d_face, d_in) * prototype_from_face, on.p - height_m * d_in);
      const bool is_free = std::none_of(all.begin(), all.end(), [&](const BodyMarker& other) {
        return (other.body_from_marker.translation - at.translation).norm() <
               0.5 * k_spacing * (other.size_m + size_m);
      });
      if (!is_free && step < 399) continue;
      placed.push_back({slot.marker, size_m, at});
      all.push_back(placed.back());
      break;
    }
  }
  return placed;
}

// The markers of the controls and of the pen, in a row below the prototype as camera 0 sees it.
std::vector<BodyMarker> control_markers(const scene::Scene& scene,
                                        const Eigen::Quaterniond& prototype_from_face) {
  const Eigen::AlignedBox3d box = bounds(scene.prototype->mesh);
  const Eigen::Vector3d d_down = prototype_from_face * Eigen::Vector3d::UnitY();
  const double half_height = 0.5 * d_down.cwiseAbs().dot(box.sizes());
  std::vector<BodyMarker> placed;
  const std::size_t count = scene.controls.size() + (scene.pen ? 1 : 0);
  for (std::size_t i = 0; i < count; ++i) {
    const double column = static_cast<double>(i) - 0.5 * static_cast<double>(count - 1);
    const Eigen::Vector3d in_face(3 * k_control_size_m * column, half_height + 1.2 * k_control_size_m, 0);
    const Pose place(prototype_from_face, box.center() + prototype_from_face * in_face);
    if (i == scene.controls.size()) {
      placed.push_back({scene.pen->marker, scene.pen->size_m, place});
      continue;
    }
    const bool is_section = scene.section && scene.controls[i].marker == scene.section->marker;
    placed.push_back(
        {scene.controls[i].marker, is_section ? scene.section->size_m : k_control_size_m, place});
  }
  return placed;
}

}  // namespace

Result<sim::World> room_for(const Rig& rig, const scene::Scene& scene) {
  if (rig.cameras.empty() || rig.projectors.empty())
    return error("rig: expected a camera and a projector, found {} and {}.", rig.cameras.size(),
                 rig.projectors.size());
  if (!scene.prototype) return error("scene: expected a prototype for the virtual room, found none.");
  sim::World world;
  world.rig = rig;
  world.camera_effects.assign(rig.cameras.size(), {.colour = true,
                                                   .exposure = 0.8,
                                                   .psf_px = 0.6,
                                                   .full_well_e = 10000,
                                                   .read_noise = 0.6,
                                                   .black_level = 4});
  world.projector_effects.assign(rig.projectors.size(),
                                 {.illuminance_at_1m = 2, .gamma = k_display_gamma, .black_level = 0.002});
  world.room.ambient = 0.6;
  world.scene = scene;

  const Eigen::Quaterniond from_face = prototype_from_face(*scene.prototype);
  const Eigen::AlignedBox3d box = bounds(scene.prototype->mesh);
  const Eigen::Quaterniond world_from_camera = rig.cameras[0].imager_from_world.rotation.conjugate();
  const Eigen::Quaterniond rotation =
      world_from_camera * exp_rotation({k_tilt_rad, 0, 0}) * from_face.conjugate();
  const Eigen::Vector3d p_middle = middle_of_sight(rig, box.diagonal().norm());
  world.world_from_prototype = Pose(rotation, p_middle - rotation * box.center());

  sim::Object prototype;
  prototype.name = "prototype";
  prototype.mesh = std::make_shared<scene::Mesh>(scene.prototype->mesh);
  prototype.albedo.setConstant(scene.prototype->albedo_image.empty() ? scene.prototype->albedo : 1.0);
  prototype.texture = scene.prototype->albedo_image;
  prototype.prototype_from_object = Pose{};
  prototype.world_from_object = world.world_from_prototype;
  world.objects.push_back(std::move(prototype));
  for (BodyMarker marker : scene.prototype->markers)
    LIMN_TRY_STATUS(sim::add_marker(world, marker, true, tracker::marker_image));
  if (const auto& balls = scene.prototype->constellation)
    sim::add_balls(world, {k_constellation_family, "prototype"}, *balls, Pose(), true);
  const std::vector<BodyMarker> placed = slot_markers(scene, from_face);
  for (std::size_t i = 0; i < placed.size(); ++i) {
    if (const auto& balls = scene.slots[i].constellation)
      sim::add_balls(world, placed[i].marker, *balls, placed[i].body_from_marker, true);
    else
      LIMN_TRY_STATUS(sim::add_marker(world, placed[i], true, tracker::marker_image));
  }
  for (const BodyMarker& marker : control_markers(scene, from_face))
    LIMN_TRY_STATUS(sim::add_marker(world, marker, true, tracker::marker_image));
  return world;
}

}  // namespace limn::session
