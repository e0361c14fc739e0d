#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace limn::calib {

/// How a pair (an image and its inverse) differs from the series' white and black, because camera or board
/// vibrate and light flickers. To first order the pair's sum is white plus black, displaced and scaled.
struct PairShake {
  /// Displacement of what the camera sees against the white image, camera pixels: the mean of both images.
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  /// Factor on the light of the image minus that of the inverse. (A factor on both moves no edge.)
  double gain_difference = 0;
  /// Standard deviations of a coordinate of the shift and of the gain difference; infinite where nothing
  /// shows them.
  double shift_stddev_px = 0, gain_stddev = 0;
};

/// White plus black of a series, where it changes most from pixel to pixel (edges of ink and of objects), and
/// where it is even. Gradients are derivatives of a Gaussian of 1 pixel, so that shifts of a tenth of that
/// are found exactly, and those of a pixel to a few percent.
class ShakeReference {
 public:
  ShakeReference(const cv::Mat& white, const cv::Mat& black);
  /// Least squares without outliers: the shift from the edges, where the stripes' own edges are accounted
  /// for; the gains of image and inverse from the even pixels.
  PairShake measure(const cv::Mat& image, const cv::Mat& inverse) const;

 private:
  struct Place {
    int x = 0, y = 0;
    // Smoothed black (whose exposure may be another one), white plus black and its derivatives.
    float black = 0, sum = 0, along_x = 0, along_y = 0;
  };
  cv::Mat sum_;  // CV_16S
  std::vector<Place> places_;
  std::vector<Place> even_;  // not smoothed
  double correlation_ = 1;   // factor on variances: neighbouring places share noise
};

/// What is taken out of a series: for each bit of the columns and the rows (most significant first), the
/// displacement against the mean of the series' images, and the gain difference of its pair. Empty: nothing.
struct Shake {
  std::array<std::vector<PairShake>, 2> axes;
  /// Displacement of the white image against the mean of all images.
  Eigen::Vector2d white_shift_px = Eigen::Vector2d::Zero();
  /// Root mean square of the images' displacements along one axis, of their gains, and standard deviations of
  /// both as measured for one pair.
  double shift_rms_px = 0, gain_rms = 0, shift_stddev_px = 0, gain_stddev = 0;
  /// Share of the displacement that the stripes follow: 1 where the camera vibrates, 0 where the board does
  /// in its plane.
  double share = 1;
  bool shakes = false, flickers = false;  ///< significantly, so that it is taken out
  /// Whether the displacement of a pair is like that of the pair before: something moved or drifts, and does
  /// not vibrate.
  bool drifts = false;
};

/// Combines the pairs of both axes. Displacements below 0.03 pixels and gains below 0.3 % (root mean square),
/// or within four standard deviations, are left alone, and so are displacements of more than a pixel, which
/// are motion.
Shake shake_of(const std::array<std::vector<PairShake>, 2>& pairs);

}  // namespace limn::calib
