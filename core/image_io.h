#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>

#include "core/result.h"

namespace limn {

/// Largest width and height of an image that is read.
inline constexpr int k_max_image_side = 32767;

/// Reads a PNG or JPEG as 8-bit grey or BGR, as stored (alpha is dropped, 16 bits become 8). A truncated or
/// damaged file is an error, never a half image; so is one larger than k_max_image_side.
Result<cv::Mat> read_image(const std::filesystem::path& path);
/// As read_image, but BGRA where the file has alpha.
Result<cv::Mat> read_image_with_alpha(const std::filesystem::path& path);
/// As read_image, converted to one 8-bit grey channel.
Result<cv::Mat> read_grey_image(const std::filesystem::path& path);
/// One channel of an 8-bit grey, BGR or BGRA image; the same data when it is grey already.
cv::Mat to_grey(const cv::Mat& image);

struct PngOptions {
  int compression = 3;          ///< 0 fast and large … 9; 1 for captures.
  double pixels_per_metre = 0;  ///< written as pHYs when > 0 (boards and markers of true size).
};
/// Writes an 8- or 16-bit PNG through a temporary file, so that `path` is either old or complete.
Status write_png(const std::filesystem::path& path, const cv::Mat& image, const PngOptions& options = {});

/// The image as a `data:image/jpeg;base64,…` address (quality 90) for self-contained HTML pages.
std::string data_uri(const cv::Mat& image);

}  // namespace limn
