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

Imager viewer_imager(const Pose& world_from_viewer, int width, int height, double fov_deg) {
  const double f = width / 2.0 / std::tan(fov_deg * std::numbers::pi / 360);
  return {"viewer", width, height, Lens::pinhole(f, f, (width - 1) / 2.0, (height - 1) / 2.0),
          world_from_viewer.inverse()};
}

}  // namespace limn
