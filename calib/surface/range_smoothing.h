#pragma once

#include <cstdint>
#include <limits>
#include <opencv2/core/mat.hpp>

#include "calib/surface/range_view.h"

namespace limn::calib {

/// Distance along each pixel's ray (m) and its variance, as triangulated; CV_64F, for differences of
/// neighbours are what matters; NaN where there is none.
struct Ranges {
  cv::Mat range, variance;
  explicit Ranges(const cv::Size& size)
      : range(size, CV_64F, cv::Scalar(std::numeric_limits<double>::quiet_NaN())), variance(range.clone()) {}
};

/// Index of a pixel in an array by rows.
inline size_t flat(const cv::Size& size, int x, int y) {
  return static_cast<size_t>(y) * static_cast<size_t>(size.width) + static_cast<size_t>(x);
}

/// Bits of RangeView::links: one surface with the pixel to the right, with the one below.
constexpr std::uint8_t k_right = 1, k_down = 2;
/// Whether two neighbours are on one surface.
bool linked(const cv::Mat& links, cv::Point a, cv::Point b);

/// Fits a quadric to the inverse ranges around each pixel, among those that `links` join with it; fills the
/// view's range, stddev and normal, with what the fits' residuals say of the noise's true size and of its
/// correlation between neighbours. Pixels that nothing holds, or that exceed the options' limits, stay as
/// they are in the view.
void smooth(const Ranges& ranges, const cv::Mat& links, const RangeOptions& options, RangeView* view);

}  // namespace limn::calib
