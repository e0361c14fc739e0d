#pragma once

#include <Eigen/Core>
#include <array>

namespace limn {

/// The lens of OpenCV's fisheye module, which ROS and Kalibr call equidistant and others Kannala-Brandt: the
/// distance from the principal point grows with a polynomial of the off-axis angle (Kannala and Brandt,
/// 2006).
struct FisheyeLens {
  double fx = 1, fy = 1, cx = 0, cy = 0;  ///< Pixels.
  double skew = 0;                        ///< Element (0, 1) of the camera matrix, in pixels.
  std::array<double, 4> k{};

  /// Pixel of a direction in the imager's frame (any length); also of one behind the imager.
  Eigen::Vector2d project(const Eigen::Vector3d& d) const;
};

}  // namespace limn
