#include "calib/held_out.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace limn::calib {
namespace {

using Eigen::Vector2d;

std::vector<int> scored_poses(const Observations& observations, const Solution& solution) {
  std::set<int> poses;
  for (const Match& match : observations.matches) {
    if (solution.world_from_board[static_cast<size_t>(match.pose)]) poses.insert(match.pose);
  }
  return {poses.begin(), poses.end()};
}

// Distance on the board between the match's point and where the projector's light of that pixel lands: the
// pixel error times the local scale of the mapping from the board's plane to projector pixels.
double error_on_board(const Observations& observations,
                      const Solution& solution,
                      const Pose& world_from_board,
                      const Match& match,
                      const Vector2d& residual) {
  const auto p = surface_point(observations, solution, world_from_board, match);
  if (!p) return std::numeric_limits<double>::quiet_NaN();
  const Imager& projector = solution.rig.projectors[static_cast<size_t>(match.projector)];
  constexpr double k_step = 1e-4;  // m
  Eigen::Matrix2d px_by_m;
  const auto at = projector.project(*p);
  for (int axis = 0; axis < 2; ++axis) {
    const auto moved =
        projector.project(*p + k_step * (world_from_board.rotation * Eigen::Vector3d::Unit(axis)));
    if (!at || !moved) return std::numeric_limits<double>::quiet_NaN();
    px_by_m.col(axis) = (*moved - *at) / k_step;
  }
  return (px_by_m.inverse() * residual).norm();
}

struct Score {
  double squared = 0;
  int cells = 0;
};

Result<Score> score_pose(const Observations& observations,
                         const Solution& solution,
                         int pose,
                         HeldOut* into) {
  LIMN_TRY(const Pose world_from_board, board_pose_from_cameras(observations, solution, pose));
  Score score;
  for (size_t i = 0; i < observations.matches.size(); ++i) {
    const Match& match = observations.matches[i];
    if (match.pose != pose) continue;
    const auto px = predicted(observations, solution, world_from_board, match);
    if (!px) continue;
    into->residuals[i] = *px - match.px_projector;
    into->errors_m[i] = error_on_board(observations, solution, world_from_board, match, into->residuals[i]);
    score.squared += into->residuals[i].squaredNorm();
    ++score.cells;
  }
  return score;
}

}  // namespace

Result<HeldOut> held_out(const Observations& observations,
                         const SolveOptions& options,
                         const Solution& solution) {
  const Vector2d none = Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  HeldOut score;
  score.residuals.assign(observations.matches.size(), none);
  score.errors_m.assign(observations.matches.size(), none.x());
  const std::vector<int> poses = scored_poses(observations, solution);
  Score total;
  for (const int pose : poses) {
    const std::string& name = observations.poses[static_cast<size_t>(pose)];
    const auto left = solve(without_pose(observations, pose), options, &solution);
    if (!left) return error("held-out solve without {}: {}", name, left.message());
    const auto scored = score_pose(observations, *left, pose, &score);
    if (!scored) return error("held-out pose {}: {}", name, scored.message());
    if (scored->cells == 0) continue;
    const double rms = std::sqrt(scored->squared / scored->cells);
    score.poses.push_back({name, rms, scored->cells});
    score.rigs.push_back(left->rig);
    score.worst_px = std::max(score.worst_px, rms);
    total.squared += scored->squared;
    total.cells += scored->cells;
  }
  if (total.cells == 0)
    return error("held-out: no match of any pose could be predicted. Capture more board poses.");
  score.rms_px = std::sqrt(total.squared / total.cells);
  return score;
}

}  // namespace limn::calib
