#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/cross_validation.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// What is smooth over the board in the held-out errors of the matches of one placement, camera and
/// projector: a polynomial of degree 2 of the camera's pixel. Wrong rigs and boards cause smooth errors; the
/// noise of single matches leaves little of them, however large it is.
struct SmoothErrors {
  int pose = 0;
  int projector = 0;
  std::vector<size_t> matches;  ///< indices; without outliers
  Eigen::MatrixX2d residuals;   ///< the smooth part at each of them, projector px
  double noise = 0;             ///< what noise alone leaves of the residuals' square sum, px^2
};

/// Groups of fewer than 18 matches are left out.
std::vector<SmoothErrors> smooth_errors(const Observations& observations,
                                        const Solution& solution,
                                        const CrossValidation& held_out);

}  // namespace limn::calib
