#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/pose.h"

namespace limn::test {

/// Predicts a body's pose from the poses that were measured in images, as published methods do.
class PosePredictor {
 public:
  virtual ~PosePredictor() = default;
  /// `at_s` grows from call to call.
  virtual void add(double at_s, const Pose& measured, const Matrix6d& covariance) = 0;
  /// At a moment not before the last measurement; to be called after the first.
  virtual Pose at(double at_s) const = 0;
};

/// Double exponential smoothing (LaViola, "Double exponential smoothing: an alternative to Kalman
/// filter-based predictive tracking", 2003): of the position and of the quaternion's components.
/// `alpha`: weight of a new measurement, 0 to 1. Intervals between images are taken to be alike.
std::unique_ptr<PosePredictor> double_exponential(double alpha);

/// A Kalman filter with constant velocity, driven by white acceleration (Welch and Bishop, "An introduction
/// to the Kalman filter", 2006; Bar-Shalom, Li and Kirubarajan, 6.2.2). `acceleration`: spectral density,
/// m²/s³, and twenty times as many rad²/s³. All axes have the same deviation: the mean of the measurement's.
std::unique_ptr<PosePredictor> constant_velocity(double acceleration);

}  // namespace limn::test
