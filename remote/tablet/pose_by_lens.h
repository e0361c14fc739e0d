#pragma once

#include <Eigen/Core>
#include <span>

#include "tracker/pose_fit.h"

namespace limn::remote {

/// How a fitted pose (boxplus's delta) depends on errors of the lens that it was fitted with: of a share of
/// the focal length, and of the image's centre in x and y as shares of the focal length. All points must be
/// of one lens.
Eigen::Matrix<double, 6, 3> pose_by_lens(std::span<const tracker::PointObservation> observations,
                                         const tracker::PoseFit& fit);

}  // namespace limn::remote
