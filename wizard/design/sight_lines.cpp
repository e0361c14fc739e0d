#include "wizard/design/sight_lines.h"

#include <Eigen/Geometry>
#include <cmath>

namespace limn::design {

using Eigen::Vector3d;

Vector3d optical_centre(const Imager& imager) { return imager.imager_from_world.inverse().translation; }

Pose upright_looking_at(const Vector3d& p_eye, const Vector3d& p_target) {
  const bool is_plumb = std::abs((p_target - p_eye).normalized().z()) > 0.999;
  return looking_at(p_eye, p_target, is_plumb ? Vector3d::UnitY() : Vector3d::UnitZ());
}

bool reaches(const Imager& imager, const Vector3d& p_world) {
  const auto px = imager.project(p_world);
  return px && imager.contains(*px);
}

}  // namespace limn::design
