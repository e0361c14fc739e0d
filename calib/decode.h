#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/patterns.h"
#include "calib/series_health.h"
#include "core/result.h"

namespace limn::calib {

struct DecodeOptions {
  /// White minus black, levels: darker pixels count as unlit. Raise for noisy cameras.
  double min_contrast = 10;
  /// Direct light (the size of picture minus inverse over the bits whose stripes are 4 to 32 projector pixels
  /// wide) over white minus black: pixels below are lit by reflections alone and count as unlit.
  double min_direct = 0.12;
  /// A bit is sure when picture and inverse differ by this share of the direct light and by min_step levels.
  /// Global light (scattered, reflected) is the same in both; blur takes the finest bits first.
  double min_share = 0.12;
  double min_step = 3;
  /// Labels of up to 2^this projector pixels are kept when that many finest bits are unsure.
  int max_coarse_bits = 3;
  /// A label further from the median of its 5x5 neighbourhood is removed, projector pixels.
  double max_from_median = 3;
  /// Of a camera's intensity, levels, standard deviation: what the coordinates' variances follow from.
  double noise = 1.5;
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
  int outliers = 0;      ///< removed
  SeriesHealth health;   ///< of the pictures themselves
  double share() const { return lit > 0 ? static_cast<double>(decoded) / lit : 0; }
};

/// Reads the pictures of one camera one pair at a time (8-bit grey is made of colour). Each Gray bit is the
/// sign of picture minus inverse. A pixel whose finest bits are unsure gets the centre of the coarser label;
/// one on the edge of a coarser stripe (an unsure bit whose finer bits say that both readings are neighbours)
/// gets that edge; one with more unsure bits what its sure bits leave near its neighbours' labels, if
/// anything. Labels then become coordinates between whole pixels (calib/subpixel.h). `width` x `height`: the
/// camera's size; a picture of another size, a missing or a damaged one is an error that names the file.
Result<Decoded> decode(const Patterns& patterns,
                       const std::vector<std::filesystem::path>& pictures,
                       int width,
                       int height,
                       const DecodeOptions& options = {});

/// The white picture of such a series, grey.
Result<cv::Mat> read_shot(const std::filesystem::path& path, int width, int height);

}  // namespace limn::calib
