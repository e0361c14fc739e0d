#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/measurement_model.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::calib {

struct SolveOptions {
  /// LENSMODEL_PINHOLE, OPENCV4, OPENCV5, OPENCV8 or OPENCV12. More values want more poses: five poses hold
  /// OPENCV4.
  std::string camera_model = "LENSMODEL_OPENCV4";
  std::string projector_model = "LENSMODEL_OPENCV4";
  /// One name for each camera, then for each projector, instead of the two above; empty: those count.
  std::vector<std::string> lens_models = {};
  /// Whether the board may be bent (two unknowns for all poses).
  bool bend = true;
  /// Residuals beyond this many standard deviations are down-weighted (Cauchy).
  double robust_at = 2;
  /// Weak knowledge about lenses, standard deviations. Of the principal point from the image's centre, as
  /// shares of the width; a projector's vertical place is left free, for projectors shift their lens upwards
  /// by anything.
  double camera_centre = 0.1;
  double projector_centre = 0.25;
  /// Of fy / fx from 1: pixels are square to well below this.
  double aspect = 0.003;
  /// Of radial and of tangential distortion values from 0.
  double radial = 0.5;
  double tangential = 0.02;
  /// Of the board's bend from 0, as a share of its width.
  double bend_share = 0.01;
};

/// What the solve found. Rig: world is camera 0. Residual arrays run parallel to the observations' arrays:
/// predicted minus measured pixel; NaN where the observation has no prediction.
struct Solution {
  Rig rig;
  std::vector<std::optional<Pose>> world_from_board;  ///< for each pose; none where no camera saw the board
  Eigen::Vector2d bend_m = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> corner_residuals, match_residuals;
  std::vector<bool> corner_outlier, match_outlier;  ///< beyond 4 standard deviations
  /// Places of the tie points, m, world; none where no tie-point observation tells the distance.
  std::vector<std::optional<Eigen::Vector3d>> points;
  std::vector<Eigen::Vector2d> tie_point_residuals;
  /// What one coordinate scatters by beyond its own stddev, px: estimated from the residuals.
  double corner_noise_px = 0, match_noise_px = 0, tie_point_noise_px = 0;
  int iterations = 0;
  /// Of the devices' unknowns, from the final Jacobian (robust weights and priors included), board poses and
  /// bend marginalised: camera 0's values and pose (boxplus's delta), camera 1's …, then the projectors'.
  /// Camera 0's pose is the world: zeros.
  Eigen::MatrixXd covariance;
  /// First index of a projector's values in it.
  int projector_at(size_t projector) const;
};

/// One least-squares problem over all cameras, projectors, board poses, the board's bend and tie points
/// (calib/bundle_adjustment.h): cameras see corners; a match says that the camera's ray meets the board where the
/// projector's pixel does. Starts from nothing but the observations. Without projectors only the cameras are
/// solved. Deterministic. Errors: too few poses, a device that saw none, a camera that shares no pose with
/// the others, observations that are not finite, no convergence.
Result<Solution> solve(const Observations& observations, const SolveOptions& options = {});

/// The same from a solution of the same devices and poses (its lens models may be others: their values start
/// at 0), with its noise as the weights; so one minimisation does. `left_out`: a pose that does not count
/// (-1: none). `to_rounding`: further down than any observation feels, for those who compare solutions.
/// Without covariance, and without what it says of single observations.
Result<Solution> solve_again(const Observations& observations,
                             const SolveOptions& options,
                             const Solution& start,
                             int left_out = -1,
                             bool to_rounding = false);

/// `solve` with a start at hand: all its rounds, covariance and residuals.
Result<Solution> solve_from(const Observations& observations,
                            const SolveOptions& options,
                            const Solution& start);

/// Pose of one placement of the board from what cameras see of its corners alone, everything else as in
/// `solution`.
Result<Pose> board_pose_from_cameras(const Observations& observations, const Solution& solution, int pose);

/// Names of the lens models: each camera's, then each projector's.
std::vector<std::string> lens_models(const Observations& observations, const SolveOptions& options);

/// Projector pixel that a solution predicts for a match whose board stands at `world_from_board`.
std::optional<Eigen::Vector2d> predicted(const Observations& observations,
                                         const Solution& solution,
                                         const Pose& world_from_board,
                                         const Match& match);
/// World point of a match on that board.
std::optional<Eigen::Vector3d> surface_point(const Observations& observations,
                                             const Solution& solution,
                                             const Pose& world_from_board,
                                             const Match& match);

}  // namespace limn::calib
