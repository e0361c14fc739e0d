#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/pose.h"
#include "core/result.h"

namespace limn::tracker {

/// The same moment seen by two systems: Limn's cameras see a body, and another system (the odometry of a
/// headset, a tracker of others) states the pose of its own sensor, which is fixed to the body.
struct PosePair {
  Pose world_from_body;
  Pose feed_from_sensor;  ///< in the other system's frame
  /// Covariances as in boxplus (core/pose.h).
  Matrix6d body_covariance = Matrix6d::Identity() * 1e-6;
  Matrix6d sensor_covariance = Matrix6d::Identity() * 1e-6;
};

using Matrix12d = Eigen::Matrix<double, 12, 12>;

/// How two systems relate: world_from_body * body_from_sensor = world_from_feed * feed_from_sensor.
struct HandEye {
  Pose world_from_feed;
  Pose body_from_sensor;
  /// Covariance of [delta of boxplus(world_from_feed, delta); delta of boxplus(body_from_sensor, delta)].
  Matrix12d covariance = Matrix12d::Zero();
  /// Root mean square of the normalised residuals: 1 where the pairs are as good as they state.
  double normalised_rms = 0;
  int outliers = 0;  ///< pairs beyond 4 standard deviations; they count little

  /// Where the sensor is: world_from_sensor by the other system's pose.
  Pose world_from_sensor(const Pose& feed_from_sensor) const { return world_from_feed * feed_from_sensor; }
};

/// Solves AX = YB for both unknown poses. The first estimate is closed (Shah, "Solving the
/// robot-world/hand-eye calibration problem using the Kronecker product", 2013), then both poses minimise the
/// pairs' normalised residuals with a robust loss. Where the residuals are larger than stated the covariance
/// is widened. Errors: fewer than 3 pairs; a pose that is not finite; rotations about one axis only, which
/// leave a direction undetermined: what to do is said.
Result<HandEye> solve_hand_eye(std::span<const PosePair> pairs);

/// A stated angular speed at a moment, for estimate_delay().
struct TurnSpeed {
  double at_s = 0;
  double rad_per_s = 0;
};

/// Angular speeds between consecutive poses, at the middle of their moments. Speeds do not depend on frames,
/// so that two systems can be compared before anything is known of them.
struct TimedRotation {
  double at_s = 0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
};
std::vector<TurnSpeed> turn_speeds(std::span<const TimedRotation> rotations);

/// By how much later `late` states the same motion than `early`, seconds, and its standard deviation.
struct Delay {
  double seconds = 0;
  double stddev_s = 0;
};

/// The delay at which both agree best, within +-`most_s`: least squares over linearly interpolated speeds,
/// the minimum found to a fraction of the interval by a parabola. Errors: less than a second in common, or no
/// motion that tells the delay.
Result<Delay> estimate_delay(std::span<const TurnSpeed> early,
                             std::span<const TurnSpeed> late,
                             double most_s = 0.5);

}  // namespace limn::tracker
