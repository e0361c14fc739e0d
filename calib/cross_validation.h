#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"
#include "core/result.h"

namespace limn::calib {

/// How well one board pose is predicted by a solve that has not seen it.
struct HeldOutPose {
  std::string pose;
  double rms_px = 0;
  int cells = 0;
};

struct CrossValidation {
  double rms_px = 0;    ///< over all cells of all poses; RMS of the 2-vector
  double worst_px = 0;  ///< of the poses' RMS
  std::vector<HeldOutPose> poses;
  std::vector<Rig> rigs;  ///< parallel to poses: the devices as solved without that pose
  /// Parallel to Observations::matches: predicted minus measured projector pixel (NaN where not scored), and
  /// the same error as a distance on the board's surface, m.
  std::vector<Eigen::Vector2d> residuals;
  std::vector<double> errors_m;
};

/// Leaves out each board pose in turn: solves without it, takes its pose from the camera's corners alone and
/// predicts the projector pixels of its matches (each the average over a cell of the board). The solves start
/// from `solution` and take its noise as weights (solve_again): a start anywhere else ends in the same place
/// (tests/calib/cross_validation_test.cpp). `with_errors`: errors_m, too. Uses all cores; the result does not depend
/// on their number.
Result<CrossValidation> cross_validate(const Observations& observations,
                         const SolveOptions& options,
                         const Solution& solution,
                         bool with_errors = true);

}  // namespace limn::calib
