#include "core/camera_files/fisheye.h"

#include <cmath>

namespace limn {

Eigen::Vector2d FisheyeLens::project(const Eigen::Vector3d& d) const {
  const double radius = d.head<2>().norm();
  const double angle = std::atan2(radius, d.z()), a2 = angle * angle;
  const double bent = angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
  const double scale = radius > 0 ? bent / radius : 0;
  return {fx * scale * d.x() + skew * scale * d.y() + cx, fy * scale * d.y() + cy};
}

}  // namespace limn
