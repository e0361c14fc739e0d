#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

namespace limn {

/// A direction and the pixel that a lens gives it.
struct LensSample {
  Eigen::Vector3d d;
  Eigen::Vector2d px;
};

/// Pixel of a direction for a lens with these values, as LensModel::project gives it: false when it has none.
/// `d_px_d_values` (2 x values, row-major, zero before) is filled when not null.
using LensFormula = std::function<bool(
    std::span<const double> values, const Eigen::Vector3d& d, Eigen::Vector2d* px, double* d_px_d_values)>;

/// Values for which the formula has the samples' pixels best, by Gauss-Newton from `values`. The first four
/// are fx, fy, cx and cy; a weak prior holds the others near 0, so that they do not cancel each other (the
/// numerator and denominator of OPENCV8 can, which would put poles into the image).
std::vector<double> fitted_values(const LensFormula& formula,
                                  std::vector<double> values,
                                  std::span<const LensSample> samples);

/// Largest distance (px) of the formula's pixels from the samples' pixels; infinite where it has none.
double worst_distance_px(const LensFormula& formula,
                         std::span<const double> values,
                         std::span<const LensSample> samples);

}  // namespace limn
