#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/lens.h"
#include "core/pose.h"

namespace limn::tracker {

/// A point of a body, observed at a pixel.
struct PointObservation {
  const Lens* lens = nullptr;
  Pose camera_from_world;
  Eigen::Vector3d p_body;
  Eigen::Vector2d px;
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();  ///< inverse of the pixel's covariance, px^-2
};

/// Prior knowledge of a pose: a Gaussian of boxplus(world_from_body, delta).
struct PosePrior {
  Pose world_from_body;
  Matrix6d information;  ///< inverse of its covariance
};

struct PoseFit {
  Pose world_from_body;
  Matrix6d covariance;    ///< covariance of boxplus(world_from_body, delta), from the observations
  double chi_square = 0;  ///< sum of squared normalised residuals, with the robust loss; includes the prior's
  double rms_px = 0;      ///< for each point, sqrt(mean(dx^2 + dy^2))
};

/// [v]x: skew(v) * w = v x w.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// Residual px - project(…) and its derivative by the delta of boxplus. False when the point has no pixel.
bool residual(const PointObservation& observation,
              const Pose& world_from_body,
              Eigen::Vector2d* difference,
              Eigen::Matrix<double, 2, 6>* d_difference = nullptr);

/// Robust cost of a pose: squared normalised residuals, linear beyond `huber` standard deviations (0: never).
/// Infinite when a point has no pixel.
double cost(std::span<const PointObservation> observations, const Pose& world_from_body, double huber);

/// Levenberg-Marquardt on the pixels through the true lenses, from `start`. nullopt when there is no minimum:
/// a point falls behind its camera, or the observations do not determine six degrees of freedom. Never NaN.
/// With a prior, the result is the nearest mode of the posterior (maximum a posteriori) with the posterior's
/// covariance there.
std::optional<PoseFit> fit_pose(std::span<const PointObservation> observations,
                                const Pose& start,
                                double huber = 0,
                                const PosePrior* prior = nullptr);

}  // namespace limn::tracker
