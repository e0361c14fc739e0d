#pragma once

// mrcal's own optimiser on the corners that one camera sees: an independent check of calib/solve's camera.

#include <Eigen/Core>
#include <map>
#include <vector>

#include "calib/observations.h"
#include "core/imager.h"
#include "core/mrcal.h"
#include "core/pose.h"

namespace limn::calib::worlds {

struct MrcalSolution {
  Imager camera;
  std::map<int, Pose> camera_from_board;  // for each pose
  double rms_px = 0;                      // 2D error of one point
};

// Solves from `start` and `camera_from_board`: a flat board, no priors. `reject`: mrcal's outlier rejection.
inline MrcalSolution mrcal_solve(const Observations& observations,
                                 int camera,
                                 const Imager& start,
                                 const std::map<int, Pose>& camera_from_board,
                                 bool reject) {
  const Board& board = observations.board;
  const int across = board.columns - 1, down = board.rows - 1, corners = across * down;
  // mrcal's board origin is its first corner, ours is one square before it.
  const Pose board_from_grid(Eigen::Quaterniond::Identity(), {board.square_m, board.square_m, 0});
  std::vector<mrcal_pose_t> frames;
  std::vector<mrcal_observation_board_t> seen;
  std::vector<mrcal_point3_t> pool;
  for (const auto& [pose, camera_from] : camera_from_board) {
    const Pose placed = camera_from * board_from_grid;
    const Eigen::Vector3d r = log_rotation(placed.rotation), t = placed.translation;
    seen.push_back({{0, -1}, static_cast<int>(frames.size())});
    frames.push_back({{{r.x(), r.y(), r.z()}}, {{t.x(), t.y(), t.z()}}});
    const size_t first = pool.size();
    pool.resize(first + static_cast<size_t>(corners), {{0, 0, -1}});  // weight -1: not seen
    for (const CornerObservation& corner : observations.corners) {
      if (corner.camera == camera && corner.pose == pose)
        pool[first + static_cast<size_t>(corner.corner)] = {{corner.px.x(), corner.px.y(), 1}};
    }
  }
  std::vector<double> values = start.lens.values;
  mrcal_lensmodel_t model{};
  mrcal_lensmodel_from_name(&model, start.lens.model.name().c_str());
  const int size[] = {start.width, start.height};
  mrcal_problem_selections_t selections{};
  selections.do_optimize_intrinsics_core = selections.do_optimize_intrinsics_distortions = true;
  selections.do_optimize_frames = true;
  selections.do_apply_outlier_rejection = reject;
  const mrcal_problem_constants_t constants{.point_min_range = 0.01, .point_max_range = 100};
  const int poses = static_cast<int>(frames.size());
  const mrcal_stats_t stats =
      mrcal_optimize(nullptr, 0, nullptr, 0, values.data(), nullptr, frames.data(), nullptr, nullptr, 1, 0,
                     poses, 0, 0, seen.data(), nullptr, poses, 0, pool.data(), &model, size, selections,
                     &constants, board.square_m, across, down, false, false);
  MrcalSolution solution{start, {}, stats.rms_reproj_error__pixels};
  solution.camera.lens.values = values;
  size_t i = 0;
  for (const auto& [pose, camera_from] : camera_from_board) {
    const mrcal_pose_t& frame = frames[i++];
    const Pose placed(exp_rotation({frame.r.x, frame.r.y, frame.r.z}), {frame.t.x, frame.t.y, frame.t.z});
    solution.camera_from_board[pose] = placed * board_from_grid.inverse();
  }
  return solution;
}

}  // namespace limn::calib::worlds
