#pragma once

#include <cstdint>
#include <limits>
#include <opencv2/core/mat.hpp>

#include "calib/surface/range_view.h"

namespace limn::calib {

/// Distance along each pixel's ray (m) and its variance, as triangulated; NaN where there is none. CV_64F,
/// because differences between neighbours are used.
struct Ranges {
  cv::Mat range, variance;
  /// The epipolar residuals of the projectors, weighted as their ranges are, in standard deviations: N(0, 1)
  /// if the variances are true. The surface's shape does not show in them. NaN where the code has no rows.
  cv::Mat epipolar;
  explicit Ranges(const cv::Size& size)
      : range(size, CV_64F, cv::Scalar(std::numeric_limits<double>::quiet_NaN())),
        variance(range.clone()),
        epipolar(range.clone()) {}
};

/// Index of a pixel in a row-major array.
inline size_t flat(const cv::Size& size, int x, int y) {
  return static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x);
}

/// Bits of RangeView::links: one surface with the pixel to the right, with the one below.
constexpr std::uint8_t k_right = 1, k_down = 2;
/// Whether two neighbours are on one surface.
bool linked(const cv::Mat& links, cv::Point a, cv::Point b);

/// Fits a quadric to the inverse ranges around each pixel, from those that `links` connect with it. Fills the
/// view's range, stddev and normal; the standard deviations use the noise's true size, as measured on what
/// wide fits leave of the ranges, and its correlation between neighbours, as measured on the epipolar
/// residuals (on the former where the code has no rows). Errors that neighbours share are in these, so that
/// averaging does not remove them. Pixels with too few neighbours, or beyond the
/// options' limits, stay unchanged in the view.
void smooth(const Ranges& ranges, const cv::Mat& links, const RangeOptions& options, RangeView* view);

}  // namespace limn::calib
