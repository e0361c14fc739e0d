#include "core/wall.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace limn {
namespace {

constexpr double k_shortest = 1e-3, k_longest = 1e3;  // sides, m
constexpr double k_right_angle_deg = 1;
constexpr double k_nearest = 0.01;  // m

}  // namespace

Status check_wall(const Wall& wall) {
  const Eigen::Vector3d right = wall.top_right - wall.top_left, down = wall.bottom_left - wall.top_left;
  for (const auto& [side, name] : {std::pair(right, "top"), std::pair(down, "left")})
    if (!(side.norm() >= k_shortest && side.norm() <= k_longest))
      return error("expected a {} side of 1 mm to 1 km, found {:.4g} mm.", name, 1e3 * side.norm());
  const double from_right_angle_deg =
      std::abs(std::asin(std::clamp(right.normalized().dot(down.normalized()), -1.0, 1.0))) * 180 /
      std::numbers::pi;
  if (from_right_angle_deg > k_right_angle_deg)
    return error(
        "expected a rectangle (top left, top right and bottom left corner), found an angle of {:.1f} degrees "
        "at "
        "the top left corner. Measure the corners again.",
        90 + (right.dot(down) < 0 ? from_right_angle_deg : -from_right_angle_deg));
  return {};
}

std::optional<Imager> seen_through(const Wall& wall, const Eigen::Vector3d& p_eye_world, cv::Size pixels) {
  const Eigen::Vector3d right = wall.top_right - wall.top_left, down = wall.bottom_left - wall.top_left;
  const Eigen::Vector3d x = right.normalized();
  const Eigen::Vector3d y = (down - down.dot(x) * x).normalized();
  const Eigen::Vector3d z = x.cross(y);  // away from a person in front of the wall
  const Eigen::Vector3d from_eye = wall.top_left - p_eye_world;
  const double distance = from_eye.dot(z);
  if (!(distance >= k_nearest)) return std::nullopt;
  const double across = pixels.width / right.norm(), along = pixels.height / down.norm();  // pixels a metre
  Imager imager;
  imager.name = "wall";
  imager.width = pixels.width;
  imager.height = pixels.height;
  imager.lens = Lens::pinhole(across * distance, along * distance, -across * from_eye.dot(x) - 0.5,
                              -along * from_eye.dot(y) - 0.5);
  Eigen::Matrix3d imager_from_world;
  imager_from_world << x.transpose(), y.transpose(), z.transpose();
  imager.imager_from_world = Pose(imager_from_world, -imager_from_world * p_eye_world);
  return imager;
}

}  // namespace limn
