#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/code/shake.h"

namespace limn::calib {

/// Variance of the difference of two intensities at a pixel; it depends on the light (shot noise).
struct DifferenceNoise {
  cv::Mat sum;                  ///< CV_16U: white plus black, levels; the sum of any pair
  std::vector<float> variance;  ///< levels^2, indexed by that sum (0 to 510)
  float at(int x, int y) const { return variance[sum.ptr<ushort>(y)[x]]; }
};

/// The derivative of an axis's labels, labels per camera pixel, in square fields of the image: planes fitted
/// to the labels. A field without enough labels on one surface has that of its neighbours.
class LabelSlopes {
 public:
  LabelSlopes() = default;
  explicit LabelSlopes(const cv::Mat& px);
  /// NaN where nothing is known.
  cv::Vec2f at(int x, int y) const;

 private:
  cv::Mat slopes_;  // CV_32FC2, one pixel for each field
};

/// One axis of Gray code as a camera saw it.
struct AxisReading {
  /// CV_16S, image minus inverse, levels; most significant bit first.
  std::vector<cv::Mat> differences;
  /// How the pairs differ from the mean image of the series, parallel to `differences`; empty: not at all.
  std::vector<PairShake> shake = {};
  LabelSlopes slopes = {};  ///< needed where `shake` displaces
  int bits() const { return static_cast<int>(differences.size()); }
  /// Index of the bit whose reading changes between label `edge` - 1 and label `edge`.
  size_t bit_at_edge(int edge) const;
};

/// The label of each pixel: the interval of projector pixels [low, end) given by the signs of its sure bits,
/// and its coordinate on this axis with a variance. CV_16S, CV_16S, CV_32F, CV_32F. Where nothing is known,
/// low = end, and px and variance are NaN.
struct AxisLabels {
  cv::Mat low, end, px, variance;
  AxisLabels(int rows, int cols);
};

/// The stripes' part in a shake: how far the edges of all labels move with what the camera sees, as a share
/// of `reading.shake`: sums for a least-squares fit, so that axes can be added.
struct StripeShare {
  double product = 0, squared = 0;  ///< share = product / squared
  double residuals = 0;             ///< sum of the squared residuals, labels^2
  int count = 0;                    ///< number of edges
};
StripeShare stripe_share(const AxisReading& reading, const AxisLabels& labels);

/// Computes subpixel coordinates. Where a bit's image and inverse cross between two camera pixels of
/// neighbouring labels, the camera sees the edge between those labels, independent of blur, global light and
/// the surface's colour. Between the two pixels the edge lies where an error function says, the profile of an
/// edge that any blur has rounded; `contrast`: image minus inverse on its two sides, CV_16S, levels, at
/// least 1. (A straight line between them errs by up to 0.1 pixels in a sharp image, which makes waves on a
/// surface where stripes and pixels beat.) Along rows and along columns, pixels between two such crossings
/// are interpolated, over longer distances by a parabola that also uses the crossings before and after them;
/// the two results are averaged by their variances. Pixels that are not between two edges keep what they
/// have. `floor_px`: standard deviation that remains besides noise. An edge that a shake has moved has its
/// label at the place where the mean image of the series shows it; of a pair whose two images had different
/// light the difference of that light is subtracted.
void refine_between_edges(const AxisReading& reading,
                          const DifferenceNoise& noise,
                          const cv::Mat& contrast,
                          double floor_px,
                          AxisLabels* labels);

}  // namespace limn::calib
