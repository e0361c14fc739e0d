#pragma once

#include <optional>
#include <vector>

#include "calib/observations.h"
#include "core/rig.h"

namespace limn::calib {

/// Decoded pixels and how far they lie from the epipolar lines of their camera pixels.
struct EpipolarScore {
  int pixels = 0;     ///< number of pixels judged
  int outliers = 0;   ///< number of these beyond k_epipolar_outlier_px, or without an epipolar line
  double rms_px = 0;  ///< projector pixels, over the inliers
};

/// The epipolar residual of one camera and projector. It needs no surface: pixels of the room count as well
/// as those of the board, so it checks regions that no board pose was fitted in; but rooms contain shiny and
/// hollow objects whose pixels are wrong.
struct EpipolarResidual {
  int camera = 0;
  int projector = 0;
  EpipolarScore board;  ///< between the board's corners
  EpipolarScore room;   ///< everywhere else
};
/// The same limit as an outlier's in decoding: a label this far from its line is a wrong one.
constexpr double k_epipolar_outlier_px = 3;

/// Signed distance (projector pixels) of `px_projector` from the camera pixel's epipolar line in the
/// projector: the projection of the pixel's ray, a curve where lenses distort. The nearest point on it is
/// found by Gauss-Newton over the ray's length. nullopt when the ray's nearest point lies behind either
/// device.
std::optional<double> epipolar_distance(const Imager& camera,
                                        const Imager& projector,
                                        const Eigen::Vector2d& px_camera,
                                        const Eigen::Vector2d& px_projector);

/// One for each camera and projector that share pixels, ordered by camera.
std::vector<EpipolarResidual> epipolar_residuals(const Rig& rig, const std::vector<DensePixel>& dense);

}  // namespace limn::calib
