#pragma once

// A rig with known truth, a board in some poses, and the observations it would make: coordinates, without
// images.

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "calib/measurement_model.h"
#include "calib/observations.h"
#include "core/rig.h"
#include "tests/support/matchers.h"

namespace limn::calib::worlds {

struct World {
  Rig rig;
  Observations observations;
  std::vector<Pose> world_from_board;
  Eigen::Vector2d bend;
  BoardShape shape;
};

struct WorldOptions {
  int cameras = 1;
  int projectors = 1;
  int poses = 6;
  double shift = 0.5;  // shift of the projectors' lenses, panel heights
  Eigen::Vector2d bend{0.0005, -0.0008};
  // Lens values after fx fy cx cy: 4, 5 or 8. Empty: a pinhole.
  std::vector<double> camera_distortion = {-0.12, 0.08, 0.0006, -0.0004};
  std::vector<double> projector_distortion = {-0.06, 0.03, 0.0004, 0.0003};
  double distance_m = 1.1;
};

inline Imager imager(const std::string& name,
                     int width,
                     int height,
                     std::vector<double> values,
                     const std::vector<double>& distortion,
                     const Pose& pose) {
  values.insert(values.end(), distortion.begin(), distortion.end());
  const std::string model =
      distortion.empty() ? "LENSMODEL_PINHOLE" : fmt::format("LENSMODEL_OPENCV{}", distortion.size());
  return {name, width, height, Lens::create(model, std::move(values)).value(), pose};
}

inline ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

inline void observe_corners(World* world, int camera, int pose) {
  const Imager& imager = world->rig.cameras[static_cast<size_t>(camera)];
  for (int id = 0; id < world->observations.board.corner_count(); ++id) {
    Eigen::Vector2d px;
    if (predict_corner(view(imager), world->world_from_board[static_cast<size_t>(pose)], world->shape,
                       world->bend, world->observations.board.p_corner(id).head<2>(), &px) &&
        imager.contains(px))
      world->observations.corners.push_back({camera, pose, id, px, 0.02});
  }
}

inline void observe_matches(World* world, int camera, int projector, int pose) {
  const Board& board = world->observations.board;
  const Imager& eye = world->rig.cameras[static_cast<size_t>(camera)];
  const Imager& light = world->rig.projectors[static_cast<size_t>(projector)];
  const Pose& world_from_board = world->world_from_board[static_cast<size_t>(pose)];
  for (int i = 0; i < 4 * board.columns * board.rows; ++i) {
    const Eigen::Vector2d xy((i % (2 * board.columns) + 0.5) * board.square_m / 2,
                             (i / (2 * board.columns) + 0.5) * board.square_m / 2);
    Eigen::Vector2d px_camera, px_projector;
    if (!predict_corner(view(eye), world_from_board, world->shape, world->bend, xy, &px_camera)) continue;
    if (!eye.contains(px_camera)) continue;
    if (!predict_match(view(eye), view(light), world_from_board, world->shape, world->bend, px_camera,
                       &px_projector))
      continue;
    if (light.contains(px_projector))
      world->observations.matches.push_back({camera, projector, pose, px_camera, px_projector, 0.02, 100});
  }
}

// The n-th pose of the board: around its centre, tilted to a side of its own.
inline Pose board_place(int n, const BoardShape& shape, double distance_m, std::mt19937_64* rng) {
  std::uniform_real_distribution<double> share(-1, 1);
  const double around = 2.4 * n, tilt = 0.35 + 0.2 * share(*rng);
  const double turn = 0.3 * share(*rng), x = 0.12 * share(*rng), y = 0.1 * share(*rng);
  const double z = distance_m + 0.15 * share(*rng);
  return Pose(exp_rotation({tilt * std::cos(around), tilt * std::sin(around), turn}), {x, y, z}) *
         Pose(Eigen::Quaterniond::Identity(), {-shape.width_m / 2, -shape.height_m / 2, 0});
}

inline void add_devices(World* world, const WorldOptions& options) {
  const Eigen::Vector3d target(0, 0, options.distance_m), up(0, -1, 0);
  const std::vector<double>& seen = options.camera_distortion;
  world->rig.cameras.push_back(imager("camera0", 1280, 1024, {1400, 1403, 652, 498}, seen, Pose()));
  if (options.cameras > 1)
    world->rig.cameras.push_back(imager("camera1", 1280, 1024, {1500, 1499, 630, 520},
                                        {-0.05, 0.02, -0.0003, 0.0005},
                                        looking_at({0.5, 0.05, 0.05}, target, up)));
  // A lens shift moves the image off the axis; the projector is turned so that it still meets the board.
  const double shift_px = 800 * options.shift;
  for (int i = 0; i < options.projectors; ++i) {
    const Pose towards = looking_at({i == 0 ? -0.35 : 0.3, 0.1, 0.0}, target, up);
    const Pose turned(exp_rotation({std::atan2(shift_px, 1600.0), 0, 0}), Eigen::Vector3d::Zero());
    world->rig.projectors.push_back(imager("projector" + std::to_string(i), 1280, 800,
                                           {1600, 1602, 655, 399.5 + shift_px}, options.projector_distortion,
                                           turned * towards));
  }
  for (const Imager& i : world->rig.cameras)
    world->observations.cameras.push_back({i.name, i.width, i.height});
  for (const Imager& i : world->rig.projectors)
    world->observations.projectors.push_back({i.name, i.width, i.height});
}

inline World make_world(const WorldOptions& options) {
  World world;
  world.bend = options.bend;
  world.observations.board = Board::parse("charuco:11x8:25mm").value();
  world.shape = {world.observations.board.width_m(), world.observations.board.height_m()};
  add_devices(&world, options);
  std::mt19937_64 rng(7);
  for (int pose = 0; pose < options.poses; ++pose) {
    world.world_from_board.push_back(board_place(pose, world.shape, options.distance_m, &rng));
    world.observations.poses.push_back("pose" + std::to_string(pose));
    for (int camera = 0; camera < options.cameras; ++camera) {
      observe_corners(&world, camera, pose);
      for (int projector = 0; projector < options.projectors; ++projector)
        observe_matches(&world, camera, projector, pose);
    }
  }
  return world;
}

inline World make_world(int cameras, int projectors, int poses, double shift) {
  WorldOptions options;
  options.cameras = cameras;
  options.projectors = projectors;
  options.poses = poses;
  options.shift = shift;
  return make_world(options);
}

// Adds a pose without a board: a bulge of 0.1 m, like a car door's, on a grid of camera 0's pixels; observed
// by every projector and every other camera.
inline void observe_scene(World* world, int columns, int rows, double distance_m = 1.1) {
  const int pose = static_cast<int>(world->observations.poses.size());
  world->observations.poses.push_back("scene" + std::to_string(pose));
  world->world_from_board.emplace_back();
  const Imager& eye = world->rig.cameras[0];
  for (int i = 0; i < columns * rows; ++i) {
    const Eigen::Vector2d px((i % columns + 0.5) / columns * eye.width,
                             (i / columns + 0.5) / rows * eye.height);
    const Eigen::Vector3d d = *eye.lens.unproject(px);
    const double bulge = std::cos(3 * d.x() / d.z()) * std::cos(4 * d.y() / d.z());
    const Eigen::Vector3d p = d / d.z() * (distance_m + 0.15 * d.x() / d.z() - 0.1 * bulge);
    const int point = static_cast<int>(world->observations.points.size());
    bool seen = false;
    const auto look = [&](const Imager& imager, bool by_projector, int which) {
      const auto there = imager.project(p);
      if (!there || !imager.contains(*there)) return;
      world->observations.tie_observations.push_back({point, by_projector, which, *there, 0.02});
      seen = true;
    };
    for (size_t k = 0; k < world->rig.projectors.size(); ++k)
      look(world->rig.projectors[k], true, static_cast<int>(k));
    for (size_t k = 1; k < world->rig.cameras.size(); ++k)
      look(world->rig.cameras[k], false, static_cast<int>(k));
    if (seen) world->observations.points.push_back({pose, 0, px});
  }
}

// Adds normal noise to all observations; their stated standard deviations become small.
inline void add_noise(World* world, double corner_px, double match_px, std::mt19937_64 rng) {
  std::normal_distribution<double> scatter(0, 1);
  const auto noise = [&](double px) {
    const double x = scatter(rng);
    return Eigen::Vector2d(px * x, px * scatter(rng));
  };
  for (CornerObservation& seen : world->observations.corners) {
    seen.px += noise(corner_px);
    seen.stddev_px = 1e-3;
  }
  for (Match& match : world->observations.matches) {
    match.px_projector += noise(match_px);
    match.stddev_px = 1e-3;
  }
  for (TiePointObservation& tie_observation : world->observations.tie_observations) {
    tie_observation.px += noise(match_px);
    tie_observation.stddev_px = 1e-3;
  }
}

}  // namespace limn::calib::worlds
