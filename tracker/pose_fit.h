#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/lens.h"
#include "core/pose.h"

namespace limn::tracker {

/// A point of a body seen at a pixel.
struct PointObservation {
  const Lens* lens = nullptr;
  Pose camera_from_world;
  Eigen::Vector3d p_body;
  Eigen::Vector2d px;
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();  ///< inverse of the pixel's covariance, px^-2
};

/// What is known of a pose before its sights: a Gaussian of boxplus(world_from_body, delta).
struct PosePrior {
  Pose world_from_body;
  Matrix6d information;  ///< inverse of its covariance
};

struct PoseFit {
  Pose world_from_body;
  Matrix6d covariance;  ///< of boxplus(world_from_body, delta), from the sights' information
  double chi_square =
      0;  ///< sum of squared residuals in standard deviations, robust where they are; the prior's included
  double rms_px = 0;  ///< per point, sqrt(mean(dx^2 + dy^2))
};

/// [v]x: skew(v) * w = v x w.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// Residual px - project(…) and its derivative by the delta of boxplus; false when the point has no pixel.
bool residual(const PointObservation& observation,
              const Pose& world_from_body,
              Eigen::Vector2d* difference,
              Eigen::Matrix<double, 2, 6>* d_difference = nullptr);

/// Robust cost of a pose: squared residuals in standard deviations, linear beyond `huber` of them (0: never).
/// Infinite when a point has no pixel.
double cost(std::span<const PointObservation> observations, const Pose& world_from_body, double huber);

/// Levenberg-Marquardt on the pixels through the true lenses, from `start`. nullopt when it has no minimum
/// there: a point falls behind its camera, or the sights do not fix six degrees of freedom. Never NaN. With a
/// prior the pose is the nearest mode of the posterior (maximum a posteriori), its covariance the posterior's
/// there.
std::optional<PoseFit> fit_pose(std::span<const PointObservation> observations,
                                const Pose& start,
                                double huber = 0,
                                const PosePrior* prior = nullptr);

}  // namespace limn::tracker
