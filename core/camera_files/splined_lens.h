#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>

#include "core/lens.h"
#include "core/result.h"

namespace limn {

/// Pixel of a direction in the imager's frame; nullopt when it has none.
using Projection = std::function<std::optional<Eigen::Vector2d>(const Eigen::Vector3d& d)>;

/// An area of the image: from its least to its largest pixel coordinates.
struct PixelArea {
  Eigen::Vector2d least, most;

  bool contains(const Eigen::Vector2d& px) const {
    return (px.array() >= least.array()).all() && (px.array() <= most.array()).all();
  }
};

/// The whole area of an image's pixels.
PixelArea area_of_image(int width, int height);

/// A lens that was made from another formula.
struct ConvertedLens {
  Lens lens;
  double worst_px = 0;  ///< Largest distance between the pixels of both formulas in the area.
};

/// Largest error of a conversion that is accepted when a camera file is read.
inline constexpr double k_most_conversion_px = 0.02;

/// A LENSMODEL_SPLINED_STEREOGRAPHIC lens with the same pixels as `exact` in the area, also for directions
/// behind the imager. `pinhole` is a lens of similar fx, fy, cx and cy; its distortion is not used. Where
/// `exact` folds back before the edge of the area, the lens ends there. Error: no grid of at most 100 knots a
/// side is within k_most_conversion_px.
Result<ConvertedLens> splined_lens(const Projection& exact, const Lens& pinhole, const PixelArea& area);

}  // namespace limn
