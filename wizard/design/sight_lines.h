#pragma once

#include <Eigen/Core>
#include <numbers>

#include "core/imager.h"
#include "core/pose.h"

namespace limn::design {

constexpr double k_degree = std::numbers::pi / 180;

/// Position of an imager, world frame.
Eigen::Vector3d optical_centre(const Imager& imager);

/// Pose (imager_from_world) of an imager at p_eye that points at p_target, with the world's z axis up in the
/// image. If it points straight down or up, the world's y axis (away from the front) is up instead.
Pose upright_looking_at(const Eigen::Vector3d& p_eye, const Eigen::Vector3d& p_target);

/// Whether a point lies in the imager's image.
bool reaches(const Imager& imager, const Eigen::Vector3d& p_world);

}  // namespace limn::design
