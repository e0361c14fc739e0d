#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "calib/board_print.h"
#include "calib/measurement_model.h"
#include "calib/noise.h"
#include "calib/observations.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::calib {

struct SolveOptions {
  /// LENSMODEL_PINHOLE, OPENCV4, OPENCV5, OPENCV8 or OPENCV12. More values need more poses: five poses
  /// determine OPENCV4.
  std::string camera_model = "LENSMODEL_OPENCV4";
  std::string projector_model = "LENSMODEL_OPENCV4";
  /// One name for each camera, then for each projector, used instead of the two above when not empty.
  std::vector<std::string> lens_models = {};
  /// The print's measured size. When it is given, the print's errors are unknowns of the solve
  /// (calib/board_print.h); without it the board is as its text says.
  std::optional<BoardMeasured> board_measured = {};
  /// By how much the print is larger than its text, where known lengths showed it (calib/judge/scale_bar.h).
  /// When it is given, the print's errors are unknowns of the solve.
  std::optional<PrintGrowth> known_growth = {};
  /// Above 0: the print's errors are unknowns although nobody measured it, and its width and height differ
  /// from its text by this share (standard deviation).
  double print_size = 0;
  /// Whether the cameras' pixels are square to k_square_pixels. Sensors are; images that were stretched are
  /// not.
  bool square_pixels = false;
  /// Whether the board may be bent (three parameters, shared by all poses).
  bool bend = true;
  /// Residuals beyond this many standard deviations are down-weighted (Cauchy).
  double robust_at = 2;
  /// Weak priors on the lenses, as standard deviations. These two: the principal point's distance from the
  /// image centre, as a share of the width. A projector's vertical principal point has no prior, because
  /// projectors shift their image upwards by any amount.
  double camera_centre = 0.1;
  double projector_centre = 0.25;
  /// Deviation of fy / fx from 1: pixels are square to well below this.
  double aspect = 0.003;
  /// Radial and tangential distortion values, from 0: those of cameras and of projectors.
  double radial = 0.5;
  double tangential = 0.02;
  double projector_radial = 0.5;
  double projector_tangential = 0.02;
  /// The board's bend from 0, as a share of its width; also its twist, where the print's errors are unknowns.
  double bend_share = 0.01;
};

/// Standard deviation of fy / fx - 1 of sensors.
constexpr double k_square_pixels = 1e-4;

/// The result of a solve. The rig's world frame is camera 0's. Residual arrays run parallel to the
/// observations' arrays: predicted minus measured pixel; NaN where the observation has no prediction.
struct Solution {
  Rig rig;
  std::vector<std::optional<Pose>> world_from_board;  ///< for each pose; none where no camera saw the board
  Eigen::Vector2d bend_m = Eigen::Vector2d::Zero();
  double twist_m = 0;
  bool print_is_measured = false;  ///< whether anything was measured that tells the print's size
  Eigen::VectorXd print;  ///< the print's errors (calib/board_print.h); empty where they were not solved
  std::vector<Eigen::Vector2d> corner_residuals, match_residuals;
  std::vector<bool> corner_outlier, match_outlier;  ///< beyond 4 standard deviations
  /// Positions of the tie points, m, world frame; none where no observation determines the depth.
  std::vector<std::optional<Eigen::Vector3d>> points;
  std::vector<Eigen::Vector2d> tie_point_residuals;
  Noise noise = {};              ///< estimated from the residuals
  double corner_scatter_px = 0;  ///< how the corners' residuals scatter: one coordinate, by the median
  int iterations = 0;
  /// Covariance of the devices' parameters, from the final Jacobian (robust weights and priors included),
  /// board poses, shape and print marginalised. Order: camera 0's values and pose (boxplus's perturbation),
  /// camera 1's …, then the projectors'. Camera 0's pose defines the world: its entries are zero.
  Eigen::MatrixXd covariance;
  /// First index of a camera's or projector's values in `covariance`.
  int camera_at(size_t camera) const;
  int projector_at(size_t projector) const;
};

/// Calibrates: one least-squares problem over all cameras, projectors, board poses, the board's bend and tie
/// points (calib/bundle_adjustment.h). Cameras observe corners; a match states that the camera's ray meets
/// the board where the projector's pixel does. Needs no initial values. Without projectors only the cameras
/// are solved. Deterministic. Errors: too few poses, a device that saw none, a camera that shares no pose
/// with the others, observations that are not finite, no convergence.
Result<Solution> solve(const Observations& observations, const SolveOptions& options = {});

/// Solves again from a solution of the same devices and poses, with its noise as the weights, so that one
/// minimisation is enough. Lens models may differ from the start's: additional values start at 0. `left_out`:
/// a pose that does not count (-1: none). `to_rounding`: minimise to rounding instead of to significance, for
/// callers that compare solutions. The result has no covariance, residuals or outliers.
Result<Solution> solve_again(const Observations& observations,
                             const SolveOptions& options,
                             const Solution& start,
                             int left_out = -1,
                             bool to_rounding = false);

/// `solve` from given initial values, with all its rounds, covariance and residuals.
Result<Solution> solve_from(const Observations& observations,
                            const SolveOptions& options,
                            const Solution& start);

/// The same rig with each pinhole lens written as LENSMODEL_OPENCV4 without distortion.
Rig with_distortion_values(Rig rig);

/// The same solution, with these lenses and with the covariance of their distortion. A pinhole lens is chosen
/// where the observations show no distortion; how much there may be nevertheless is part of what is not
/// known. The prior of these is that of lenses that pass as pinholes.
Solution with_distortion_unknown(const Observations& observations,
                                 Solution solution,
                                 const SolveOptions& options = {});

/// The options that the covariance of with_distortion_unknown() is computed with.
SolveOptions unknown_distortion(const Solution& solution, SolveOptions options);

/// Covariance of the devices' parameters without the observations of one board pose, at the same solution.
Eigen::MatrixXd covariance_without(const Observations& observations,
                                   const Solution& solution,
                                   const SolveOptions& options,
                                   int pose);

/// The print's errors as a share of its size (difference of width and height, and what its smooth errors may
/// add), where the observations show that the print has errors; 0 otherwise. They show where the corners fit
/// better with them, or where camera 0's pixels are square only with them: what the pixels do stays with the
/// image, what the print does turns with a board that is rolled.
struct UnevenPrint {
  double size = 0;
  bool are_pixels_square = false;  ///< whether camera 0's pixels are, with the print's errors as unknowns
  /// Whether they are square only so. Held-out errors do not show this: uneven pixels predict as well.
  bool is_shown_by_pixels = false;
};
UnevenPrint uneven_print(const Observations& observations,
                         const SolveOptions& options,
                         const Solution& solution);

/// The shape of the board as solved.
BoardShape board_shape(const Observations& observations, const Solution& solution);

/// Estimates the pose of one placement of the board from the corners that cameras see, everything else as in
/// `solution`.
Result<Pose> board_pose_from_cameras(const Observations& observations, const Solution& solution, int pose);

/// Names of the lens models: one for each camera, then for each projector.
std::vector<std::string> lens_models(const Observations& observations, const SolveOptions& options);

/// Predicts the projector pixel of a match whose board stands at `world_from_board`.
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
