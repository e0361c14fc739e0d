#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/code/patterns.h"

namespace limn::calib {

/// What one group of images that together light everything evenly says of itself: an image and its
/// inverse, white and black, or the steps of a sinusoid. Medians and shares are over the lit samples.
struct GroupQuality {
  int first = 0;        ///< index of its first image in the series
  int count = 2;        ///< images in it
  double level = 1;     ///< median of its sum over what the sum should be: moves with exposure and room light
  double contrast = 0;  ///< mean of |image - inverse| as a share of the full contrast; blur lowers it
  double off =
      0;  ///< share of samples whose sum is wrong by over a quarter of their contrast and by no noise
};

/// An image that does not show what its place in the series says. File name and finding make a sentence:
/// "shows the same as 016.png", "or 005.png has changed places with 016.png or 017.png", "and 005.png do not
/// add up to what the other pairs do". An image that has changed places with its own inverse is not found:
/// the projection then looks mirrored.
struct OddImage {
  std::filesystem::path file;
  std::string finding;
};

/// Scatter of one intensity over repeated images: variance = read + per_level * intensity, levels^2 (the
/// sensor's own noise with rounding, and the light's).
struct IntensityNoise {
  double read = 2.25;
  double per_level = 0;
};

/// How sound one series of images is (one camera, one projector, one pose): measurements only, taken while
/// it is decoded, on a sparse grid of pixels. What they mean is for others to judge.
struct CaptureQuality {
  int camera = 0, projector = 0, pose = 0;
  int samples = 0;         ///< lit pixels looked at; without any, all else stays as it is here
  double saturated = 0;    ///< share of them that white drives to full scale
  double black_level = 0;  ///< median under black, levels: room light, the projector's black, the sensor's
  double white_level = 0;  ///< median under white, levels
  std::vector<GroupQuality> groups;       ///< in the order of the series, white and black last
  int widest_stripe_px = 0;              ///< of the pairs; narrow ones lose contrast to blur, all of them
  double level_low = 1, level_high = 1;  ///< range of the pairs' levels without those of odd images
  /// phase: mean light of the sinusoids' steps between black (0) and white (1), median; 0.5 when the
  /// projector's response is what they were drawn for. Other codes: 0.5.
  double wave_level = 0.5;
  std::vector<OddImage> odd;
  /// Of what is seen between the first group and the last, camera pixels: the median over patches with
  /// texture, and the length that a tenth of them exceeds. A patch is 1/10 of the image's width.
  double shift_px = 0, shift_worst_px = 0;
  int shift_patches = 0;  ///< with texture; 0: motion is not measured
  /// Share of the lit pixels whose finest bit is unsure, on the worse axis: defocus.
  double unsure_finest = 0;
  IntensityNoise noise;  ///< from how the pairs' sums scatter; as it is here when there are too few samples
};

/// Looks at the images of a series as they pass: keeps some thousand pixels of each, and small images of
/// the first group and the last.
class CaptureQualityProbe {
 public:
  CaptureQualityProbe(const Patterns& patterns, int width, int height);
  /// Image number `index`, 8-bit grey; every index once, in any order.
  void add_image(int index, const cv::Mat& image);
  /// After all of them. `files`: the images' names.
  CaptureQuality quality(const std::vector<std::filesystem::path>& files) const;

 private:
  Patterns patterns_;
  int width_ = 0, height_ = 0, stride_ = 1;
  std::vector<cv::Mat> samples_;  ///< of each image, one row of bytes
  cv::Mat first_, last_;          ///< sums of the first and the last group, reduced
};

}  // namespace limn::calib
