#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// Statistics of normalised residuals: each coordinate's residual divided by its stated standard deviation.
/// Where the statement is true they are N(0, 1): mean 0, deviation 1, 0.3 % beyond 3.
struct ResidualStatistics {
  int count = 0;        ///< over coordinates that the solve did not mark as outliers
  double mean = 0;      ///< over those that the solve did not call outliers
  double stddev = 0;    ///< the same
  double beyond_3 = 0;  ///< share, outliers included
};

struct NormalisedResiduals {
  ResidualStatistics corners;   ///< stated: the corner's own deviation and the noise that the solve found
  ResidualStatistics matches;   ///< the same
  ResidualStatistics held_out;  ///< predicted minus measured, stated by held_out_covariances
};

/// The expected covariance of each match's held-out prediction, projector px^2: the match's own noise, the
/// pose's (estimated from noisy corners), and the devices' covariance including its effect on the pose (what
/// camera and pose share cancels). The devices' covariance is that of the solve with all poses, widened by
/// n / (n - 1) poses. Not finite where a match has no prediction.
std::vector<Eigen::Matrix2d> held_out_covariances(const Observations& observations, const Solution& solution);

/// `held_out_residuals` runs parallel to the matches; NaN where none was scored.
NormalisedResiduals normalised_residuals(const Observations& observations,
                                         const Solution& solution,
                                         const std::vector<Eigen::Vector2d>& held_out_residuals);

}  // namespace limn::calib
