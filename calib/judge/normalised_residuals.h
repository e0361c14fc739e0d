#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// Residuals over their stated deviations, each coordinate for itself. Where the statement is true they are
/// N(0, 1): mean 0, deviation 1, 0.3 % beyond 3.
struct ResidualStatistics {
  int count = 0;        ///< coordinates
  double mean = 0;      ///< over those that the solve did not call outliers
  double stddev = 0;    ///< likewise
  double beyond_3 = 0;  ///< share, outliers included
};

struct NormalisedResiduals {
  ResidualStatistics corners;   ///< by the corner's own deviation and the noise that the solve found
  ResidualStatistics matches;   ///< likewise
  ResidualStatistics held_out;  ///< predicted minus measured, by held_out_covariances
};

/// What a held-out prediction of each match is expected to scatter by, projector px^2: the match's own noise,
/// the pose's (taken from noisy corners), and the devices' covariance, whose effect on the pose is counted
/// (what camera and pose share cancels). The covariance is that of the solve with all poses, widened by
/// n / (n - 1) poses. Not finite where a match has no prediction.
std::vector<Eigen::Matrix2d> held_out_covariances(const Observations& observations, const Solution& solution);

/// `held_out_residuals` runs parallel to the matches; NaN where none was scored.
NormalisedResiduals normalised_residuals(const Observations& observations,
            const Solution& solution,
            const std::vector<Eigen::Vector2d>& held_out_residuals);

}  // namespace limn::calib
