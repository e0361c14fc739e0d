#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/lens.h"
#include "core/pose.h"

namespace limn::tracker {

/// The pose of a marker relative to its camera.
struct MarkerPose {
  Pose camera_from_marker;
  double rms_px = 0;    ///< for each corner
  Matrix6d covariance;  ///< covariance of boxplus(camera_from_marker, delta) in this branch
  /// Likelihood of this branch relative to the other, exp(-chi^2 / 2) of its corners; both add up to 1.
  double weight = 1;
};

/// The corners of a square marker in its own frame, in the order of Detection::corners_px.
std::array<Eigen::Vector3d, 4> square_corners(double size_m);

/// Poses of a square marker from its corners in the raw image: both branches of the planar ambiguity (IPPE:
/// Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV 2014), each refined on the pixels
/// through the lens, likeliest first. There is one when both branches lead to the same minimum, and none when
/// the corners cannot be the image of a square: degenerate, not finite, outside the lens's domain, or
/// mirrored.
std::vector<MarkerPose> marker_poses(const Lens& lens,
                                     double size_m,
                                     const std::array<Eigen::Vector2d, 4>& corners_px,
                                     const std::array<Eigen::Matrix2d, 4>& corner_covariance);

/// The two rotations of a plane whose homography takes plane coordinates to (x/z, y/z) of the camera. This is
/// IPPE's closed form from value and derivative at the plane's origin. Empty when the plane is seen edge-on.
std::vector<Eigen::Matrix3d> planar_rotations(const Eigen::Matrix3d& normalised_from_plane);

/// The homography that takes a square of side 2 about the origin (corners in marker order) to four points.
/// All zero when the points are degenerate.
Eigen::Matrix3d homography_from_square(const std::array<Eigen::Vector2d, 4>& points);

}  // namespace limn::tracker
