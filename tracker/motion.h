#pragma once

#include <Eigen/Core>

#include "core/pose.h"
#include "tracker/pose_fit.h"

namespace limn::tracker {

using Matrix18d = Eigen::Matrix<double, 18, 18>;

/// A body's motion at a moment: a Gaussian over pose, velocity and acceleration on SE(3), as an error-state
/// filter holds it. Velocities are [angular; linear], rad/s and m/s, in the world's axes; the linear one is
/// that of the body's origin. Accelerations likewise.
struct Motion {
  Pose world_from_body;
  Vector6d velocity = Vector6d::Zero();
  Vector6d acceleration = Vector6d::Zero();
  /// Covariance of [delta of boxplus(world_from_body, delta); velocity; acceleration].
  Matrix18d covariance = Matrix18d::Zero();

  Matrix6d pose_covariance() const { return covariance.topLeftCorner<6, 6>(); }
};

/// White noise that drives a body's motion, as power spectral densities.
struct MotionNoise {
  double turn_jerk = 0;   ///< angular jerk, rad²/s⁵
  double jerk = 0;        ///< linear jerk, m²/s⁵
  double turn_drift = 0;  ///< angular velocity, rad²/s
  double drift = 0;       ///< linear velocity, m²/s
};

/// The motion `seconds` (>= 0) later: acceleration is constant except for the noise, and the covariance
/// grows.
Motion propagated(const Motion& motion, double seconds, const MotionNoise& noise);

/// The pose `seconds` later, without covariance.
Pose pose_after(const Motion& motion, double seconds);

/// The motion after its pose was measured. `fit` is the posterior of a pose whose prior was the motion's own
/// (fit_pose with prior_of). Velocity and acceleration follow through their correlation with the pose.
Motion corrected(const Motion& motion, const PoseFit& fit);
PosePrior prior_of(const Motion& motion);

/// A single Gaussian with mean and covariance of the weighted mixture of two; the weights add up to 1.
Motion mixed(const Motion& a, double weight_a, const Motion& b, double weight_b);

/// The motion by two estimates of it at one moment whose errors are independent.
Motion combined(const Motion& a, const Motion& b);

/// Log likelihood of the measurement, except for a constant that all motions share: Laplace's approximation
/// of the integral over the pose, from the cost and width of the posterior.
double log_evidence(const Motion& prior, const PoseFit& fit);

}  // namespace limn::tracker
