#pragma once

#include <optional>
#include <string>

#include "core/pose.h"

namespace limn {

/// What another tracking system states of one of its sensors at a moment, in its own frame (that of the
/// feed): right-handed, metres.
struct ForeignPose {
  std::string sensor;  ///< its name or number there
  Pose feed_from_sensor;
  bool has_rotation = true;  ///< false: the system states a position only, and the rotation means nothing
  bool is_lost = false;      ///< the system says that it does not see the sensor; the pose means nothing
  std::optional<double> time_s = {};      ///< on the system's own clock
  std::optional<double> stddev_m = {};    ///< standard deviation of one coordinate, where stated
  std::optional<double> stddev_rad = {};  ///< the same of the rotation about one axis
};

}  // namespace limn
