#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>

#include "core/result.h"

namespace limn {

/// Largest width and height of an image that is read.
inline constexpr int k_max_image_side = 32767;
/// Largest number of pixels of an image that is read (16384 x 16384). More would fill the memory.
inline constexpr long k_max_image_pixels = 1L << 28;

/// The 16 bits of a sample are all used: 65535 is white.
inline constexpr int k_full_range = 16;
/// How many bits of a 16-bit sample are used is found from the image itself, see find_used_bits().
inline constexpr int k_found_in_image = 0;

/// What becomes of an image's alpha.
enum class Alpha {
  on_white,  ///< Transparent parts are shown on white, as paper is.
  ignored,   ///< The colours are read as stored, as textures of opaque materials are.
  kept       ///< The image is BGRA if the file has alpha.
};

/// How an image is read.
struct ImageOptions {
  bool grey = false;  ///< One grey channel, for images with colour, too; alpha cannot be kept then.
  Alpha alpha = Alpha::on_white;
  /// 16-bit samples: how many of the bits are used, counted from the lowest one: 10, 12, 14, k_full_range or
  /// k_found_in_image. The highest eight of these bits are read. Cameras store 10 to 14 bits at the low end;
  /// images that programs draw (textures) have the full range.
  int used_bits = k_full_range;
};

/// Reads PNG, JPEG, PBM, PGM, PPM, BMP, TIFF, WebP or TGA as 8-bit grey or BGR, with rows and columns as
/// stored (an EXIF orientation is ignored, because a camera's calibration belongs to the stored pixels).
/// A truncated or damaged file is an error, and so is an image larger than k_max_image_side or
/// k_max_image_pixels, an animation and floating-point samples.
Result<cv::Mat> read_image(const std::filesystem::path& path, const ImageOptions& options = {});
/// As read_image, from the bytes of a file. `name` says in messages where the image is.
Result<cv::Mat> decode_image(std::string_view bytes,
                             const std::string& name,
                             const ImageOptions& options = {});
/// As read_image, but BGRA where the file has alpha.
Result<cv::Mat> read_image_with_alpha(const std::filesystem::path& path);
/// Reads a camera's image as one 8-bit grey channel. Images of one series need the `used_bits` of its
/// brightest image, so that their levels can be compared.
Result<cv::Mat> read_grey_image(const std::filesystem::path& path, int used_bits = k_found_in_image);

/// How many bits of its 16-bit samples an image uses, from the lowest one: 10, 12 or 14 if no sample is above
/// 1023, 4095 or 16383, else k_full_range. Samples that are all multiples of 64 (of at least eight levels) or
/// of 257 are 8 or 10 bits at the high end of a dark image: k_full_range. So are images of 8 bits, with
/// alpha, and those that state their white (a PGM's maximum). The brightest image of a series decides for all
/// of them.
Result<int> find_used_bits(const std::filesystem::path& path);

/// Whether the name's extension is that of an image that read_image reads, in capitals or not.
bool is_image_name(const std::filesystem::path& path);
/// `path` if it exists, else the image of the same name with another of these extensions; `path` if there is
/// none.
std::filesystem::path find_image(const std::filesystem::path& path);

/// An 8-bit grey, BGR or BGRA image as one grey channel. If it is grey already, the data are shared.
cv::Mat to_grey(const cv::Mat& image);

struct PngOptions {
  int compression = 3;          ///< From 0 (fast, large file) to 9 (slow, small file); captures use 1.
  double pixels_per_metre = 0;  ///< Written as pHYs when > 0, so that boards and markers print in true size.
};
/// Writes an 8- or 16-bit PNG. When writing fails, `path` keeps its old content.
Status write_png(const std::filesystem::path& path, const cv::Mat& image, const PngOptions& options = {});

/// The image as a `data:image/jpeg;base64,…` address (quality 90) for self-contained HTML pages.
std::string data_uri(const cv::Mat& image);

}  // namespace limn
