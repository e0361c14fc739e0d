#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "tracker/balls/constellation_pose.h"

namespace limn::tracker {

/// A constellation that was measured from images of it; vectors run parallel to its balls.
struct LearnedConstellation {
  Constellation
      constellation;  ///< origin at the balls' mean, x along their largest extent, z along the smallest
  /// Standard deviations along its axes (m), free of the frame's own. Errors that all images share (the
  /// stated diameter, lens, overexposure) are not included.
  std::vector<Eigen::Vector3d> stddev_m;
  std::vector<int> images_of_ball;  ///< number of images that each was used in
  int images = 0;                   ///< number of images used
  double rms_px = 0;                ///< for each centre
  int dropped_balls = 0;            ///< balls of the reference image that too few other images show
};

/// Learns where balls of one size are on a rigid body, from images in which the body is turned; each view is
/// an image of a different moment. The image with most balls must show all of them. Distances from the
/// camera, which the balls' angular sizes give, start a bundle adjustment of the body's poses and the balls'
/// places on centres and sizes, in turn with the identification of the balls in each image. The scale is that
/// of `radius_m`. Error: fewer than three images agree, the places are not determined, or
/// check_constellation() refuses the constellation.
Result<LearnedConstellation> learn_constellation(std::span<const BallView> views,
                                                 double radius_m,
                                                 const std::string& name);

}  // namespace limn::tracker
