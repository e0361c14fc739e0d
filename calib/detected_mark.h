#pragma once

#include <Eigen/Core>
#include <array>
#include <string>

namespace limn::calib {

/// A square mark in a camera's image of one pose.
struct DetectedMark {
  int camera = 0;
  int pose = 0;
  std::string name;                           ///< `family:id`
  std::array<Eigen::Vector2d, 4> corners_px;  ///< in order around the mark
  double stddev_px = 0.05;                    ///< standard deviation of one coordinate of a corner
};

}  // namespace limn::calib
