#pragma once

#include <Eigen/Core>

#include "core/pose.h"
#include "tracker/pose_fit.h"

namespace limn::tracker {

using Matrix18d = Eigen::Matrix<double, 18, 18>;

/// How a body moves at a moment: a Gaussian of pose, velocity and acceleration on SE(3), as an error-state
/// filter holds it. Velocities are [angular; linear], rad/s and m/s, in the world's axes, the linear one that
/// of the body's origin; accelerations likewise.
struct Motion {
  Pose world_from_body;
  Vector6d velocity = Vector6d::Zero();
  Vector6d acceleration = Vector6d::Zero();
  /// Of [delta of boxplus(world_from_body, delta); velocity; acceleration].
  Matrix18d covariance = Matrix18d::Zero();

  Matrix6d pose_covariance() const { return covariance.topLeftCorner<6, 6>(); }
};

/// What moves a body unforeseen: white noise, as power spectral densities.
struct MotionNoise {
  double turn_jerk = 0;   ///< of the angular acceleration's rate, rad²/s⁵
  double jerk = 0;        ///< of the linear acceleration's rate, m²/s⁵
  double turn_drift = 0;  ///< of the orientation itself, rad²/s
  double drift = 0;       ///< of the position itself, m²/s
};

/// The motion `seconds` (>= 0) later: acceleration constant but for the noise, covariance grown.
Motion propagated(const Motion& motion, double seconds, const MotionNoise& noise);

/// Its pose alone.
Pose pose_after(const Motion& motion, double seconds);

/// The motion after its pose was measured: `fit` is the posterior of a pose whose prior was the motion's own
/// (fit_pose with prior_of). Velocity and acceleration follow by their correlation with the pose.
Motion corrected(const Motion& motion, const PoseFit& fit);
PosePrior prior_of(const Motion& motion);

/// One Gaussian with mean and covariance of two, weighted; weights add up to 1.
Motion mixed(const Motion& a, double weight_a, const Motion& b, double weight_b);

/// Log likelihood of what was measured, up to what all motions share: Laplace's approximation of the integral
/// over the pose, by the cost and the width of the posterior.
double log_evidence(const Motion& prior, const PoseFit& fit);

}  // namespace limn::tracker
