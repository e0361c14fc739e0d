#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"
#include "core/result.h"

namespace limn::calib {

/// How well one board pose is predicted by a solve without it.
struct HeldOutPose {
  std::string pose;
  double rms_px = 0;
  int cells = 0;
};

struct CrossValidation {
  double rms_px = 0;    ///< over all cells of all poses; RMS of the 2-vector's length
  double worst_px = 0;  ///< largest RMS of a pose
  std::vector<HeldOutPose> poses;
  std::vector<Rig> rigs;  ///< parallel to poses: the devices as solved without that pose
  /// Parallel to Observations::matches: predicted minus measured projector pixel (NaN where not scored), and
  /// the same error as a distance on the board's surface, m.
  std::vector<Eigen::Vector2d> residuals;
  std::vector<double> errors_m;
};

/// Cross-validation over board poses. Leaves out each board pose in turn: solves without it, estimates its
/// pose from the camera's corners alone and predicts the projector pixels of its matches (each is the average
/// over a cell of the board). The solves start from `solution` and take their weights from its noise
/// (solve_again); another start ends in the same minimum (tests/calib/cross_validation_test.cpp).
/// `with_errors`: also compute errors_m. Uses all cores; the result does not depend on their number.
Result<CrossValidation> cross_validate(const Observations& observations,
                                       const SolveOptions& options,
                                       const Solution& solution,
                                       bool with_errors = true);

/// A pose whose held-out RMS is more than 2.5 times the median of the others' (`others_px`). `index`: in
/// CrossValidation::poses.
struct OddPose {
  size_t index = 0;
  double others_px = 0;
};
/// The largest first; none among fewer than four poses.
std::vector<OddPose> odd_poses(const CrossValidation& score);

}  // namespace limn::calib
