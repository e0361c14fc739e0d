#pragma once

#include <Eigen/Core>
#include <opencv2/core/types.hpp>
#include <optional>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// A flat screen with a known place in the world, such as a wall of a CAVE: corners of its image as seen by a
/// person in front of it, world frame, m.
struct Wall {
  Eigen::Vector3d top_left = {0, 0, 0};
  Eigen::Vector3d top_right = {1, 0, 0};
  Eigen::Vector3d bottom_left = {0, 1, 0};

  bool operator==(const Wall&) const = default;
};

/// Error: a side shorter than 1 mm or longer than 1 km, or sides that are not at right angles within 1
/// degree.
Status check_wall(const Wall& wall);

/// The imager that has its centre at an eye and each pixel where the wall has it: drawn with it, the wall is
/// a window through which the eye sees the world. Its frustum is off-axis (Kooima, "Generalized Perspective
/// Projection", 2008): focal lengths and principal point follow from the eye's place. `pixels`: the wall's
/// size in pixels. nullopt: the eye is nearer than 1 cm or behind the wall.
std::optional<Imager> seen_through(const Wall& wall, const Eigen::Vector3d& p_eye_world, cv::Size pixels);

}  // namespace limn
