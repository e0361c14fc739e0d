#pragma once

#include <optional>
#include <vector>

#include "calib/observations.h"
#include "core/lens.h"
#include "core/pose.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::calib {

/// Initial values for the solve: devices and board poses that are right to some pixels.
struct Seed {
  std::vector<Imager> cameras, projectors;
  std::vector<std::optional<Pose>> world_from_board;
};

/// Initialises cameras by OpenCV's calibration with a plain lens, linked through boards that two of them see,
/// else through a projector whose light both see on boards of their own, else through tie points that both
/// see; and projectors by the direct linear transform from points on the boards to their pixels, which holds
/// for any lens shift. The models (one for each device) define how many values each lens has; values that are
/// not initialised are 0.
Result<Seed> seed(const Observations& observations,
                  const std::vector<LensModel>& camera_models,
                  const std::vector<LensModel>& projector_models);

/// Estimates the pose of the one board whose corners `observations` holds, by PnP on the camera that sees
/// most of them.
Result<Pose> board_pose_seed(const Observations& observations, const Rig& rig);

/// A camera matrix and pose.
struct LinearCamera {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  Pose imager_from_world;
};
/// Estimates them from at least 6 points in general position and their pixels (Hartley and Zisserman, section
/// 7.1, with normalised coordinates). nullopt when the points lie on a plane or give no proper camera.
std::optional<LinearCamera> linear_camera(const std::vector<Eigen::Vector3d>& p_world,
                                          const std::vector<Eigen::Vector2d>& px);

}  // namespace limn::calib
