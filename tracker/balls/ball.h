#pragma once

#include <Eigen/Core>

namespace limn::tracker {

/// A sphere found in one image. Its outline's rays are a right circular cone around the direction of its
/// centre, whatever the lens: there is no error from perspective, as the centre of the outline's ellipse has.
struct Ball {
  Eigen::Vector3d d_centre =
      Eigen::Vector3d::UnitZ();  ///< unit direction of the sphere's centre, camera frame
  double half_angle = 0;         ///< the outline's cone's, radians
  /// The raw pixel that d_centre projects to, and its covariance (px^2). It comes from the residuals of the
  /// outline's pixels, and is widened where the residuals agree with each other along the outline.
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d centre_covariance = Eigen::Matrix2d::Zero();
  double radius_px = 0;          ///< mean radius of the outline in the image
  double half_angle_stddev = 0;  ///< standard deviation of half_angle, from the same residuals, radians
  double contrast =
      0;  ///< light inside minus light outside, 0 to 255 for the whole range; negative: a dark ball
  double blur_px = 0;  ///< the outline's blur, as the sigma of a Gaussian
};

/// Distance of a sphere's centre from the camera, in the unit of `radius`.
double distance_of(const Ball& ball, double radius);

/// Centre of the sphere in the camera's frame, in the unit of `radius`.
Eigen::Vector3d p_centre_of(const Ball& ball, double radius);

}  // namespace limn::tracker
