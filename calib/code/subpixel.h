#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

namespace limn::calib {

/// Variance of the difference of two intensities at a pixel: light has noise of its own.
struct DifferenceNoise {
  cv::Mat sum;                  ///< CV_16U: white plus black, levels; what any pair adds up to
  std::vector<float> variance;  ///< levels^2, by that sum (0 to 510)
  float at(int x, int y) const { return variance[sum.ptr<ushort>(y)[x]]; }
};

/// One axis of Gray code as a camera saw it.
struct AxisReading {
  /// CV_16S, image minus inverse, levels; most significant bit first.
  std::vector<cv::Mat> differences;
  int bits() const { return static_cast<int>(differences.size()); }
  /// Of the bit whose reading changes between label `edge` - 1 and label `edge`.
  const cv::Mat& at_edge(int edge) const;
};

/// What the bits of each pixel say: the projector pixels [low, end) by the signs of its sure bits, and its
/// coordinate on this axis with a variance. CV_16S, CV_16S, CV_32F, CV_32F; low = end where nothing is known,
/// NaN likewise.
struct AxisLabels {
  cv::Mat low, end, px, variance;
  AxisLabels(int rows, int cols);
};

/// Coordinates between whole pixels: where a bit's image and inverse cross between two camera pixels of
/// neighbouring labels, the camera looks at the edge between those labels, whatever the blur, the global
/// light and the surface's colour. Along rows and along columns, pixels between two such places get what
/// lies between; the two answers are averaged by their variances. Pixels between no two edges keep what they
/// have. `floor_px`: what remains besides noise.
void refine_between_edges(const AxisReading& reading,
                          const DifferenceNoise& noise,
                          double floor_px,
                          AxisLabels* labels);

}  // namespace limn::calib
