#pragma once

#include <optional>
#include <vector>

#include "calib/observations.h"
#include "core/rig.h"

namespace limn::calib {

/// Decoded pixels and how far they lie from the epipolar lines of their camera pixels.
struct EpipolarScore {
  int pixels = 0;     ///< judged
  int outliers = 0;   ///< of them, beyond k_epipolar_outlier_px, or without a line
  double rms_px = 0;  ///< projector pixels, over the others
};

/// Of one camera and projector. It needs no surface: the room counts as well as the board, so it judges what
/// the board poses cannot have fitted; but rooms hold shiny and hollow things whose pixels are wrong.
struct EpipolarResidual {
  int camera = 0;
  int projector = 0;
  EpipolarScore board;  ///< between the board's corners
  EpipolarScore room;   ///< everywhere else
};
/// What a decoding calls an outlier, too: a label this far from where it belongs is a wrong one.
constexpr double k_epipolar_outlier_px = 3;

/// Signed distance (projector pixels) of `px_projector` from the image, in the projector, of the camera
/// pixel's ray: a curve where lenses distort. The nearest point on it is found by Gauss-Newton over the ray's
/// length. Nullopt when the ray's nearest point lies behind either device.
std::optional<double> epipolar_distance(const Imager& camera,
                                        const Imager& projector,
                                        const Eigen::Vector2d& px_camera,
                                        const Eigen::Vector2d& px_projector);

/// One for each camera and projector that share pixels, cameras first to last.
std::vector<EpipolarResidual> epipolar_residuals(const Rig& rig, const std::vector<DensePixel>& dense);

}  // namespace limn::calib
