#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calib/code/patterns.h"
#include "calib/code/shake.h"

namespace limn::calib {

/// Measurements of one group of images that together illuminate everything evenly: an image and its inverse,
/// white and black, or the steps of a sinusoid. Medians and shares are over the illuminated samples.
struct GroupQuality {
  int first = 0;        ///< index of its first image in the series
  int count = 2;        ///< number of images in it
  double level = 1;     ///< median of (sum / expected sum): changes with exposure and room light
  double contrast = 0;  ///< mean of |image - inverse| as a share of the full contrast; blur lowers it
  /// Share of samples whose sum is wrong by more than a quarter of their contrast and by more than noise.
  double off = 0;
};

/// An image that does not show what its index in the series says. File name and finding make a sentence:
/// "shows the same as 016.png", "or 005.png has changed places with 016.png or 017.png", "and 005.png do not
/// add up to what the other pairs do". An image that has changed places with its own inverse is not found:
/// the projection then looks mirrored.
struct OddImage {
  std::filesystem::path file;
  std::string finding;
};

/// Noise of one intensity over repeated images: variance = read + per_level * intensity, levels^2 (the
/// sensor's own noise with rounding, and the light's).
struct IntensityNoise {
  double read = 2.25;
  double per_level = 0;
};

/// Quality measurements of one series of images (one camera, one projector, one pose), taken during decoding
/// on a sparse grid of pixels. calib/judge interprets them.
struct CaptureQuality {
  int camera = 0, projector = 0, pose = 0;
  int samples = 0;         ///< illuminated pixels in the grid; when 0, all other members keep their defaults
  double saturated = 0;    ///< share of the samples that white drives to full scale
  double black_level = 0;  ///< median under black, levels: room light, the projector's black, the sensor's
  double white_level = 0;  ///< median under white, levels
  std::vector<GroupQuality> groups;  ///< in the order of the series, white and black last
  int widest_stripe_px = 0;  ///< widest stripes of the pairs; blur lowers the contrast of all narrow stripes
  double level_low = 1, level_high = 1;  ///< range of the pairs' levels without those of odd images
  /// phase: mean light of the sinusoids' steps between black (0) and white (1), median; 0.5 when the
  /// projector's response is the one that they were drawn for. Other codes: 0.5.
  double wave_level = 0.5;
  std::vector<OddImage> odd;
  /// Image shift between the first group and the last, camera pixels: the median over patches with texture,
  /// and the length that a tenth of the patches exceeds. A patch is 1/10 of the image's width.
  double shift_px = 0, shift_worst_px = 0;
  int shift_patches = 0;  ///< number of patches with texture; 0: motion is not measured
  /// Share of the illuminated pixels whose finest bit is unsure, on the worse axis: a measure of defocus.
  double unsure_finest = 0;
  /// What decoding has taken out because camera, board or light was not still. The labels belong to the mean
  /// of the series' images: a point that white shows at p is there at p - shake.white_shift_px.
  Shake shake;
  IntensityNoise noise;  ///< from the scatter of the pairs' sums; this default when there are too few samples
};

/// Measures a series while its images are read: keeps some thousand pixels of each image, and small copies of
/// the first group and the last.
class CaptureQualityProbe {
 public:
  CaptureQualityProbe(const Patterns& patterns, int width, int height);
  /// Adds image number `index`, 8-bit grey; every index once, in any order.
  void add_image(int index, const cv::Mat& image);
  /// Call it after all images. `files`: the images' names. `shake`: what their pairs show; its edges are no
  /// sign of a wrong image.
  CaptureQuality quality(const std::vector<std::filesystem::path>& files, const Shake& shake = {}) const;

 private:
  Patterns patterns_;
  int width_ = 0, height_ = 0, stride_ = 1;
  std::vector<cv::Mat> samples_;  ///< one row of bytes for each image
  cv::Mat first_, last_;          ///< sums of the first and the last group, at reduced size
};

}  // namespace limn::calib
