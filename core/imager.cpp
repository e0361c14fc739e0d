#include "core/imager.h"

#include <cmath>
#include <numbers>

namespace limn {

std::optional<Eigen::Vector2d> Imager::project(const Eigen::Vector3d& p_world) const {
  return lens.project(imager_from_world * p_world);
}

std::optional<Ray> Imager::ray(const Eigen::Vector2d& px) const {
  const auto d_imager = lens.unproject(px);
  if (!d_imager) return std::nullopt;
  const Pose world_from_imager = imager_from_world.inverse();
  return Ray{world_from_imager.translation, world_from_imager.rotation * *d_imager};
}

bool Imager::contains(const Eigen::Vector2d& px) const {
  return px.x() >= -0.5 && px.y() >= -0.5 && px.x() <= width - 0.5 && px.y() <= height - 0.5;
}

std::optional<Imager> resized(const Imager& imager, int width, int height) {
  if (imager.width <= 0 || imager.height <= 0 || width <= 0 || height <= 0) return std::nullopt;
  const double scale_x = double(width) / imager.width, scale_y = double(height) / imager.height;
  constexpr double k_same_aspect = 0.01;
  if (std::abs(scale_x / scale_y - 1) > k_same_aspect) return std::nullopt;
  Imager changed = imager;
  changed.width = width;
  changed.height = height;
  auto& values = changed.lens.values;  // the first are fx, fy, cx, cy; pixel centres are at integers
  values[0] *= scale_x;
  values[1] *= scale_y;
  values[2] = (values[2] + 0.5) * scale_x - 0.5;
  values[3] = (values[3] + 0.5) * scale_y - 0.5;
  return changed;
}

Imager viewer_imager(const Pose& world_from_viewer, int width, int height, double fov_deg) {
  const double f = width / 2.0 / std::tan(fov_deg * std::numbers::pi / 360);
  return {"viewer", width, height, Lens::pinhole(f, f, (width - 1) / 2.0, (height - 1) / 2.0),
          world_from_viewer.inverse()};
}

}  // namespace limn
