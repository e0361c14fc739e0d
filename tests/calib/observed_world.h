#pragma once

#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "calib/observations.h"
#include "calib/predict.h"
#include "core/rig.h"

namespace limn::calib {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// A rig with known truth, a board shown to it in some poses, and what it would observe.
struct World {
  Rig rig;
  Observations observations;
  std::vector<Pose> world_from_board;
  Vector2d bend{0.0005, -0.0008};
  BoardShape shape;
};

inline Imager imager(
    const std::string& name, int width, int height, std::vector<double> values, const Pose& pose) {
  return {name, width, height, Lens::create("LENSMODEL_OPENCV4", std::move(values)).value(), pose};
}

inline ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

inline void observe_corners(World* world, int camera, int pose) {
  const Imager& imager = world->rig.cameras[static_cast<size_t>(camera)];
  for (int id = 0; id < world->observations.board.corner_count(); ++id) {
    Vector2d px;
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
    const Vector2d xy((i % (2 * board.columns) + 0.5) * board.square_m / 2,
                      (i / (2 * board.columns) + 0.5) * board.square_m / 2);
    Vector2d px_camera, px_projector;
    if (!predict_corner(view(eye), world_from_board, world->shape, world->bend, xy, &px_camera)) continue;
    if (!eye.contains(px_camera)) continue;
    if (!predict_match(view(eye), view(light), world_from_board, world->shape, world->bend, px_camera,
                       &px_projector))
      continue;
    if (light.contains(px_projector))
      world->observations.matches.push_back({camera, projector, pose, px_camera, px_projector, 0.02, 100});
  }
}

/// `shift`: how far the projectors' lenses are shifted, panel heights.
inline World make_world(int cameras, int projectors, int poses, double shift) {
  World world;
  world.observations.board = Board::parse("charuco:11x8:25mm").value();
  world.shape = {world.observations.board.width_m(), world.observations.board.height_m()};
  world.rig.cameras.push_back(
      imager("camera0", 1280, 1024, {1400, 1403, 652, 498, -0.12, 0.08, 0.0006, -0.0004}, Pose()));
  if (cameras > 1)
    world.rig.cameras.push_back(imager("camera1", 1280, 1024,
                                       {1500, 1499, 630, 520, -0.05, 0.02, -0.0003, 0.0005},
                                       looking_at({0.5, 0.05, 0.05}, {0, 0, 1.1}, {0, -1, 0})));
  // A lens shift moves the picture off the axis: the projector is turned so that it still meets the board.
  const double cy = 399.5 + 800 * shift;
  for (int i = 0; i < projectors; ++i) {
    const Vector3d p_eye(i == 0 ? -0.35 : 0.3, 0.1, 0.0);
    const Pose towards = looking_at(p_eye, {0, 0, 1.1}, {0, -1, 0});
    const Pose turned(exp_rotation({std::atan2(800 * shift, 1600.0), 0, 0}), Vector3d::Zero());
    world.rig.projectors.push_back(imager("projector" + std::to_string(i), 1280, 800,
                                          {1600, 1602, 655, cy, -0.06, 0.03, 0.0004, 0.0003},
                                          turned * towards));
  }
  std::mt19937_64 rng(7);
  std::uniform_real_distribution<double> share(-1, 1);
  for (int pose = 0; pose < poses; ++pose) {
    const double around = 2.4 * pose, tilt = 0.35 + 0.2 * share(rng);
    const Pose board_at(exp_rotation({tilt * std::cos(around), tilt * std::sin(around), 0.3 * share(rng)}),
                        Vector3d(0.12 * share(rng), 0.1 * share(rng), 1.1 + 0.15 * share(rng)));
    const Pose centre(Eigen::Quaterniond::Identity(),
                      {-world.shape.width_m / 2, -world.shape.height_m / 2, 0});
    world.world_from_board.push_back(board_at * centre);
    world.observations.poses.push_back("pose" + std::to_string(pose));
  }
  for (const Imager& i : world.rig.cameras) world.observations.cameras.push_back({i.name, i.width, i.height});
  for (const Imager& i : world.rig.projectors)
    world.observations.projectors.push_back({i.name, i.width, i.height});
  for (int pose = 0; pose < poses; ++pose) {
    for (int camera = 0; camera < cameras; ++camera) {
      observe_corners(&world, camera, pose);
      for (int projector = 0; projector < projectors; ++projector)
        observe_matches(&world, camera, projector, pose);
    }
  }
  return world;
}

/// Normal noise on every corner and every match; their own deviations become all but nothing.
inline void add_noise(World* world, double corner_px, double match_px, std::mt19937_64 rng) {
  std::normal_distribution<double> scatter(0, 1);
  for (CornerSeen& seen : world->observations.corners) {
    seen.px += corner_px * Vector2d(scatter(rng), scatter(rng));
    seen.stddev_px = 1e-3;
  }
  for (Match& match : world->observations.matches) {
    match.px_projector += match_px * Vector2d(scatter(rng), scatter(rng));
    match.stddev_px = 1e-3;
  }
}

}  // namespace limn::calib
