#include "calib/cross_validation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "calib/measurement_model.h"
#include "core/median.h"
#include "core/parallel.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr double k_odd_pose = 2.5;  // held-out RMS of a pose divided by the median of the others

std::vector<int> scored_poses(const Observations& observations, const Solution& solution) {
  std::set<int> poses;
  for (const CornerObservation& corner : observations.corners) {
    const bool counts = observations.projectors.empty();  // else the matches are scored
    if (counts && solution.world_from_board[static_cast<size_t>(corner.pose)]) poses.insert(corner.pose);
  }
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

// The result for one pose; each is written by one thread.
struct PoseScore {
  Status status;
  Rig rig;
  double squared = 0;
  int cells = 0;
};

// Whether the board's pose is estimated from this corner, or the corner is predicted: alternating, as the
// colours of a chessboard.
bool gives_pose(const Board& board, int corner) {
  const int across = board.columns - 1;
  return (corner % across + corner / across) % 2 == 0;
}

// Without projectors: the board's pose from half of the corners predicts the other half.
void score_corners(const Observations& observations, const Solution& left, int pose, PoseScore* score) {
  constexpr std::ptrdiff_t k_least = 6;  // corners that a pose is estimated from
  Observations half = observations;
  std::erase_if(half.corners, [&](const CornerObservation& corner) {
    return corner.pose != pose || !gives_pose(observations.board, corner.corner);
  });
  if (std::ssize(half.corners) < k_least) return;
  const auto world_from_board = board_pose_from_cameras(half, left, pose);
  if (!world_from_board) {
    score->status = error("held-out pose {}: {}", observations.poses[static_cast<size_t>(pose)],
                          world_from_board.message());
    return;
  }
  const BoardShape shape = board_shape(observations, left);
  for (const CornerObservation& corner : observations.corners) {
    if (corner.pose != pose || gives_pose(observations.board, corner.corner)) continue;
    const Imager& camera = left.rig.cameras[static_cast<size_t>(corner.camera)];
    Vector2d px;
    if (!predict_corner({camera.lens.model, camera.lens.values, camera.imager_from_world}, *world_from_board,
                        shape, left.bend_m, printed_corner(observations.board, left.print, corner.corner),
                        &px))
      continue;
    score->squared += (px - corner.px).squaredNorm();
    ++score->cells;
  }
}

PoseScore score_pose(const Observations& observations,
                     const SolveOptions& options,
                     const Solution& solution,
                     int pose,
                     bool with_errors,
                     CrossValidation* into) {
  const std::string& name = observations.poses[static_cast<size_t>(pose)];
  const auto left = solve_again(observations, options, solution, pose, with_errors);
  PoseScore score;
  if (!left) {
    score.status = error("held-out solve without {}: {}", name, left.message());
    return score;
  }
  score.rig = left->rig;
  if (observations.projectors.empty()) {
    score_corners(observations, *left, pose, &score);
    return score;
  }
  const auto world_from_board = board_pose_from_cameras(observations, *left, pose);
  if (!world_from_board) {
    score.status = error("held-out pose {}: {}", name, world_from_board.message());
    return score;
  }
  for (size_t i = 0; i < observations.matches.size(); ++i) {
    const Match& match = observations.matches[i];
    if (match.pose != pose) continue;
    const auto px = predicted(observations, *left, *world_from_board, match);
    if (!px) continue;
    into->residuals[i] = *px - match.px_projector;
    if (with_errors)
      into->errors_m[i] = error_on_board(observations, *left, *world_from_board, match, into->residuals[i]);
    score.squared += into->residuals[i].squaredNorm();
    ++score.cells;
  }
  return score;
}

// Scores every pose independently, on as many threads as there are cores; each thread writes its own results.
std::vector<PoseScore> score_poses(const Observations& observations,
                                   const SolveOptions& options,
                                   const Solution& solution,
                                   const std::vector<int>& poses,
                                   bool with_errors,
                                   CrossValidation* into) {
  std::vector<PoseScore> scores(poses.size());
  parallel_for(static_cast<int>(poses.size()), [&](int i) {
    const auto at = static_cast<size_t>(i);
    scores[at] = score_pose(observations, options, solution, poses[at], with_errors, into);
  });
  return scores;
}

}  // namespace

std::vector<OddPose> odd_poses(const CrossValidation& score) {
  std::vector<OddPose> odd;
  for (size_t i = 0; i < score.poses.size(); ++i) {
    std::vector<double> others;
    for (size_t k = 0; k < score.poses.size(); ++k) {
      if (k != i) others.push_back(score.poses[k].rms_px);
    }
    if (others.size() < 3) continue;
    const double others_px = median(others);
    if (score.poses[i].rms_px >= k_odd_pose * others_px) odd.push_back({i, others_px});
  }
  std::stable_sort(odd.begin(), odd.end(), [&](const OddPose& a, const OddPose& b) {
    return score.poses[a.index].rms_px > score.poses[b.index].rms_px;
  });
  return odd;
}

Result<CrossValidation> cross_validate(const Observations& observations,
                                       const SolveOptions& options,
                                       const Solution& solution,
                                       bool with_errors) {
  const Vector2d none = Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  CrossValidation score;
  score.residuals.assign(observations.matches.size(), none);
  score.errors_m.assign(observations.matches.size(), none.x());
  const std::vector<int> poses = scored_poses(observations, solution);
  const auto scores = score_poses(observations, options, solution, poses, with_errors, &score);
  double squared = 0;
  int cells = 0;
  for (size_t i = 0; i < poses.size(); ++i) {
    LIMN_TRY_STATUS(scores[i].status);
    if (scores[i].cells == 0) continue;
    const double rms = std::sqrt(scores[i].squared / scores[i].cells);
    score.poses.push_back({observations.poses[static_cast<size_t>(poses[i])], rms, scores[i].cells});
    score.rigs.push_back(scores[i].rig);
    score.worst_px = std::max(score.worst_px, rms);
    squared += scores[i].squared;
    cells += scores[i].cells;
  }
  if (cells == 0)
    return error("held-out: no {} of any pose could be predicted. Capture more board poses.",
                 observations.projectors.empty() ? "corner" : "match");
  score.rms_px = std::sqrt(squared / cells);
  return score;
}

}  // namespace limn::calib
