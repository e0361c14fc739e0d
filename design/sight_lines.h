#pragma once

#include <Eigen/Core>
#include <numbers>

#include "core/imager.h"
#include "core/pose.h"

namespace limn::apps {

constexpr double k_degree = std::numbers::pi / 180;

/// Where an imager stands, world frame.
Eigen::Vector3d eye_of(const Imager& imager);

/// Looking from the eye at the target (imager_from_world), world z up in the image; straight down or up, what
/// is away from the front.
Pose upright_looking_at(const Eigen::Vector3d& p_eye, const Eigen::Vector3d& p_target);

/// Whether a point lies in the imager's image.
bool reaches(const Imager& imager, const Eigen::Vector3d& p_world);

}  // namespace limn::apps
