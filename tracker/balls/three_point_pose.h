#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/pose.h"

namespace limn::tracker {

/// The poses camera_from_body in which three points of a body lie on three rays from the camera, at most four
/// (Grunert 1841; Haralick, Lee, Ottenberg, Noelle, "Review and analysis of solutions of the three point
/// perspective pose estimation problem", IJCV 1994). `d_camera` are unit directions. Where two solutions have
/// merged and noise leaves none, their middle is returned, which suits the rays nearly. Empty when the points
/// are on a line or no pose comes near.
std::vector<Pose> three_point_poses(const std::array<Eigen::Vector3d, 3>& p_body,
                                    const std::array<Eigen::Vector3d, 3>& d_camera);

}  // namespace limn::tracker
