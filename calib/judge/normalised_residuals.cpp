#include "calib/judge/normalised_residuals.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/measurement_model.h"

namespace limn::calib {
namespace {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;

ImagerView view(const Imager& imager) {
  return {imager.lens.model, imager.lens.values, imager.imager_from_world};
}

// First index of a camera's values in the solution's covariance; the six of its pose follow them.
int camera_at(const Solution& solution, int camera) {
  int at = 0;
  for (int i = 0; i < camera; ++i)
    at += solution.rig.cameras[static_cast<size_t>(i)].lens.model.value_count() + 6;
  return at;
}

double corner_variance(const Solution& solution, const CornerObservation& seen) {
  return std::pow(solution.noise.corner.total(seen.stddev_px), 2);
}

double match_variance(const Solution& solution, const Match& match) {
  return std::pow(solution.noise.match.total(match.stddev_px), 2);
}

// A board pose estimated from corners alone: its covariance by their noise, and its derivatives by the
// devices' parameters (6 x parameters).
struct PoseByCorners {
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  MatrixXd by_devices;
  bool known = false;
};

PoseByCorners pose_by_corners(const Observations& observations, const Solution& solution, int pose) {
  const BoardShape shape = board_shape(observations, solution);
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  MatrixXd product = MatrixXd::Zero(6, solution.covariance.cols());
  const auto& board = solution.world_from_board[static_cast<size_t>(pose)];
  for (size_t i = 0; board && i < observations.corners.size(); ++i) {
    const CornerObservation& seen = observations.corners[i];
    if (seen.pose != pose || solution.corner_outlier[i]) continue;
    const Imager& camera = solution.rig.cameras[static_cast<size_t>(seen.camera)];
    Vector2d px;
    Derivatives d;
    if (!predict_corner(view(camera), *board, shape, solution.bend_m,
                        printed_corner(observations.board, solution.print, seen.corner), &px, &d))
      continue;
    const double weight = 1 / corner_variance(solution, seen);
    const int at = camera_at(solution, seen.camera), values = camera.lens.model.value_count();
    normal += weight * d.board_pose.transpose() * d.board_pose;
    product.middleCols(at, values) += weight * d.board_pose.transpose() * d.camera_values;
    product.middleCols(at + values, 6) += weight * d.board_pose.transpose() * d.camera_pose;
  }
  PoseByCorners by;
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> inverse(normal);
  by.known = inverse.isPositive() && inverse.rcond() > 1e-15;
  if (!by.known) return by;
  by.covariance = inverse.solve(Eigen::Matrix<double, 6, 6>::Identity());
  by.by_devices = -inverse.solve(product);
  return by;
}

Matrix2d predicted_covariance(const Observations& observations,
                              const Solution& solution,
                              const PoseByCorners& by,
                              double widened,
                              const Match& match) {
  const Matrix2d none = Matrix2d::Constant(std::numeric_limits<double>::quiet_NaN());
  const auto& board = solution.world_from_board[static_cast<size_t>(match.pose)];
  if (!by.known || !board) return none;
  const Imager& camera = solution.rig.cameras[static_cast<size_t>(match.camera)];
  const Imager& projector = solution.rig.projectors[static_cast<size_t>(match.projector)];
  Vector2d px;
  Derivatives d;
  if (!predict_match(view(camera), view(projector), *board, board_shape(observations, solution),
                     solution.bend_m, match.px_camera, &px, &d))
    return none;
  const int camera_column = camera_at(solution, match.camera),
            camera_values = camera.lens.model.value_count();
  const int projector_column = solution.projector_at(static_cast<size_t>(match.projector)),
            projector_values = projector.lens.model.value_count();
  MatrixXd sensitivity = d.board_pose * by.by_devices;
  sensitivity.middleCols(camera_column, camera_values) += d.camera_values;
  sensitivity.middleCols(camera_column + camera_values, 6) += d.camera_pose;
  sensitivity.middleCols(projector_column, projector_values) += d.projector_values;
  sensitivity.middleCols(projector_column + projector_values, 6) += d.projector_pose;
  return widened * sensitivity * solution.covariance * sensitivity.transpose() +
         d.board_pose * by.covariance * d.board_pose.transpose() +
         match_variance(solution, match) * Matrix2d::Identity();
}

// Accumulates normalised residuals.
struct Tally {
  int all = 0, kept = 0, beyond = 0;
  double sum = 0, squared = 0;

  void add(const Vector2d& residual, const Vector2d& variance, bool outlier) {
    for (int axis = 0; axis < 2; ++axis) {
      const double pull = residual[axis] / std::sqrt(variance[axis]);
      if (!std::isfinite(pull)) continue;
      ++all;
      if (std::abs(pull) > 3) ++beyond;
      if (outlier) continue;
      ++kept;
      sum += pull;
      squared += pull * pull;
    }
  }
  ResidualStatistics finished() const {
    ResidualStatistics s;
    s.count = all;
    if (kept == 0) return s;
    s.mean = sum / kept;
    s.stddev = std::sqrt(std::max(0.0, squared / kept - s.mean * s.mean));
    s.beyond_3 = static_cast<double>(beyond) / all;
    return s;
  }
};

}  // namespace

std::vector<Matrix2d> held_out_covariances(const Observations& observations, const Solution& solution) {
  std::vector<PoseByCorners> poses;
  double known = 0;
  for (int pose = 0; pose < static_cast<int>(observations.poses.size()); ++pose) {
    poses.push_back(pose_by_corners(observations, solution, pose));
    known += poses.back().known ? 1 : 0;
  }
  const double widened = known > 1 ? known / (known - 1) : 1;
  std::vector<Matrix2d> covariances;
  for (const Match& match : observations.matches)
    covariances.push_back(
        predicted_covariance(observations, solution, poses[static_cast<size_t>(match.pose)], widened, match));
  return covariances;
}

NormalisedResiduals normalised_residuals(const Observations& observations,
                                         const Solution& solution,
                                         const std::vector<Vector2d>& held_out_residuals) {
  Tally corners, matches, held_out;
  for (size_t i = 0; i < observations.corners.size(); ++i)
    corners.add(solution.corner_residuals[i],
                Vector2d::Constant(corner_variance(solution, observations.corners[i])),
                solution.corner_outlier[i]);
  const std::vector<Matrix2d> covariances = held_out_covariances(observations, solution);
  for (size_t i = 0; i < observations.matches.size(); ++i) {
    const Match& match = observations.matches[i];
    matches.add(solution.match_residuals[i], Vector2d::Constant(match_variance(solution, match)),
                solution.match_outlier[i]);
    held_out.add(held_out_residuals[i], covariances[i].diagonal(), solution.match_outlier[i]);
  }
  return {corners.finished(), matches.finished(), held_out.finished()};
}

}  // namespace limn::calib
