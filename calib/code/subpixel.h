#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

namespace limn::calib {

/// Variance of the difference of two intensities at a pixel; it depends on the light (shot noise).
struct DifferenceNoise {
  cv::Mat sum;                  ///< CV_16U: white plus black, levels; the sum of any pair
  std::vector<float> variance;  ///< levels^2, indexed by that sum (0 to 510)
  float at(int x, int y) const { return variance[sum.ptr<ushort>(y)[x]]; }
};

/// One axis of Gray code as a camera saw it.
struct AxisReading {
  /// CV_16S, image minus inverse, levels; most significant bit first.
  std::vector<cv::Mat> differences;
  int bits() const { return static_cast<int>(differences.size()); }
  /// The differences of the bit whose reading changes between label `edge` - 1 and label `edge`.
  const cv::Mat& at_edge(int edge) const;
};

/// The label of each pixel: the interval of projector pixels [low, end) given by the signs of its sure bits,
/// and its coordinate on this axis with a variance. CV_16S, CV_16S, CV_32F, CV_32F. Where nothing is known,
/// low = end, and px and variance are NaN.
struct AxisLabels {
  cv::Mat low, end, px, variance;
  AxisLabels(int rows, int cols);
};

/// Computes subpixel coordinates. Where a bit's image and inverse cross between two camera pixels of
/// neighbouring labels, the camera sees the edge between those labels, independent of blur, global light and
/// the surface's colour. Along rows and along columns, pixels between two such crossings are interpolated;
/// the two results are averaged by their variances. Pixels that are not between two edges keep what they
/// have. `floor_px`: standard deviation that remains besides noise.
void refine_between_edges(const AxisReading& reading,
                          const DifferenceNoise& noise,
                          double floor_px,
                          AxisLabels* labels);

}  // namespace limn::calib
