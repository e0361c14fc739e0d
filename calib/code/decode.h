#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/code/patterns.h"
#include "calib/code/capture_quality.h"
#include "core/result.h"

namespace limn::calib {

struct DecodeOptions {
  /// White minus black, levels: darker pixels count as unlit. Raise for noisy cameras.
  double min_contrast = 10;
  /// Direct light (the size of image minus inverse over the bits whose stripes are 4 to 32 projector pixels
  /// wide) over white minus black: pixels below are lit by reflections alone and count as unlit.
  double min_direct = 0.2;
  /// A bit is sure when image and inverse differ by this share of the direct light and by min_step levels.
  /// Global light (scattered, reflected) is the same in both; blur takes the finest bits first.
  double min_share = 0.12;
  double min_step = 3;
  /// Likewise for bits with stripes of 16 pixels and more, which no blur takes: they are weak only where the
  /// pixel lies on a stripe's edge, or sees two surfaces at once. 0.35 is half a standard deviation of the
  /// blur from the edge. xor has no such bits.
  double min_coarse_share = 0.35;
  /// Labels of up to 2^this projector pixels are kept when that many finest bits are unsure.
  int max_coarse_bits = 3;
  /// A label further from the median of its 5x5 neighbourhood is removed, projector pixels.
  double max_from_median = 3;
  /// What is left of a coordinate's error without noise: blur that is not symmetric, curved surfaces.
  double floor_px = 0.01;
};

/// Which projector pixel lights each camera pixel.
struct Decoded {
  cv::Mat px_projector;  ///< CV_32FC2: column, row (pixel centres at integers); NaN where there is none
  cv::Mat variance;      ///< CV_32FC2: of the two coordinates, px^2
  cv::Mat contrast;      ///< CV_8U: white minus black, levels
  int lit = 0;           ///< camera pixels that the projector lights directly
  int decoded = 0;       ///< of them, with a label (outliers excluded)
  int outliers = 0;      ///< removed: further than max_from_median from their neighbours' median
  /// Camera pixels whose white is min_contrast above black, for those who look at these two images alone:
  /// shadows that reflections light and ink that glare veils are among them, whose bits hold nothing.
  int contrasted = 0;
  CaptureQuality quality;  ///< of the images themselves
  double share() const { return lit > 0 ? static_cast<double>(decoded) / lit : 0; }
};

/// Reads the images of one camera one after another (8-bit grey is made of colour). Each bit is the sign of
/// image minus inverse. A pixel whose finest bits are unsure gets the centre of the coarser label; one on
/// the edge of a coarser stripe (an unsure bit whose finer bits say that both readings are neighbours) gets
/// that edge. Where the bits leave more open, and where a lone label contradicts its neighbours, the labels
/// near the neighbours' are weighed by how much noise each would need; without a likely one the pixel has no
/// label. Labels then become coordinates between whole pixels, by the stripes' edges (calib/code/subpixel.h)
/// or by the phase (calib/code/phase.h). Variances follow from the noise that the series itself shows.
/// `width` x `height`: the camera's size; an image of another size, a missing or a damaged one is an error
/// that names the file.
Result<Decoded> decode(const Patterns& patterns,
                       const std::vector<std::filesystem::path>& images,
                       int width,
                       int height,
                       const DecodeOptions& options = {});

/// The white image of such a series, grey.
Result<cv::Mat> read_shot(const std::filesystem::path& path, int width, int height);

}  // namespace limn::calib
