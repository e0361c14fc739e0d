#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/code/capture_quality.h"
#include "calib/code/patterns.h"
#include "core/image_io.h"
#include "core/result.h"

namespace limn::calib {

struct DecodeOptions {
  /// White minus black, levels: pixels below this count as not illuminated. Raise it for noisy cameras.
  double min_contrast = 10;
  /// Direct light (size of image minus inverse over the bits whose stripes are 4 to 32 projector pixels wide)
  /// divided by white minus black: pixels below this are illuminated by reflections alone and count as not
  /// illuminated.
  double min_direct = 0.2;
  /// A bit is sure when image and inverse differ by this share of the direct light and by min_step levels.
  /// Global light (scattered, reflected) is the same in both images; blur weakens the finest bits first.
  double min_share = 0.12;
  double min_step = 3;
  /// The same for bits with stripes of 16 pixels and more, which blur does not weaken: they are weak only
  /// where the pixel lies on a stripe's edge, or sees two surfaces at once. 0.35 is half a standard deviation
  /// of the blur from the edge. xor has no such bits.
  double min_coarse_share = 0.35;
  /// Labels that are up to 2^this projector pixels wide are kept when that many finest bits are unsure.
  int max_coarse_bits = 3;
  /// Labels that differ by more than this from the median of their 5x5 neighbourhood are removed; projector
  /// pixels.
  double max_from_median = 3;
  /// Standard deviation of a coordinate without noise: asymmetric blur, curved surfaces.
  double floor_px = 0.01;
};

/// Which projector pixel illuminates each camera pixel.
struct Decoded {
  /// CV_32FC2: column, row (pixel centres at integers); NaN where there is none. Where the series shows
  /// columns only, the row is always NaN and its variance infinite.
  cv::Mat px_projector;
  cv::Mat variance;  ///< CV_32FC2: variances of the two coordinates, px^2
  cv::Mat contrast;  ///< CV_8U: white minus black, levels
  int lit = 0;       ///< number of camera pixels that the projector illuminates directly
  int decoded = 0;   ///< number of these with a label (outliers excluded)
  int outliers = 0;  ///< removed: further than max_from_median from the median of their neighbours
  /// Number of camera pixels whose white is at least min_contrast above black. In contrast to `lit`, it
  /// includes shadows illuminated by reflections and dark ink brightened by glare, whose bits hold no signal.
  int contrasted = 0;
  CaptureQuality quality;  ///< quality of the images themselves
  double share() const { return lit > 0 ? static_cast<double>(decoded) / lit : 0; }
};

/// Decodes the images of one camera, read one after another (colour is converted to 8-bit grey). Each bit is
/// the sign of image minus inverse. A pixel whose finest bits are unsure gets the centre of the coarser
/// label; a pixel on the edge of a coarser stripe (an unsure bit whose finer bits say that both readings are
/// neighbours) gets that edge. Where the bits are more ambiguous, and where a single label contradicts its
/// neighbours, the labels near the neighbours' are compared by how much noise each would need; without a
/// likely one the pixel has no label. Labels then become subpixel coordinates, by the stripes' edges
/// (calib/code/subpixel.h) or by the phase (calib/code/phase.h); displacements of the images against each
/// other and flicker are taken out of the edges (calib/code/shake.h). Variances follow from the noise that
/// the series itself shows. `width` x `height`: the camera's size. An image of another size, a missing or a
/// damaged one is an error that names the file.
Result<Decoded> decode(const Patterns& patterns,
                       const std::vector<std::filesystem::path>& images,
                       int width,
                       int height,
                       const DecodeOptions& options = {});

/// Reads an image of such a series, as grey. `used_bits` are those of the series' white image
/// (find_used_bits); white itself needs none.
Result<cv::Mat> read_shot(const std::filesystem::path& path,
                          int width,
                          int height,
                          int used_bits = k_found_in_image);

}  // namespace limn::calib
