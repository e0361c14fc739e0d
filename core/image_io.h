#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>

#include "core/result.h"

namespace limn {

/// Largest width and height of an image that is read.
inline constexpr int k_max_image_side = 32767;

/// Reads a PNG or JPEG as 8-bit grey or BGR, as stored (alpha is dropped, 16 bits become 8). A truncated or
/// damaged file is an error, and so is an image larger than k_max_image_side.
Result<cv::Mat> read_image(const std::filesystem::path& path);
/// As read_image, but BGRA where the file has alpha.
Result<cv::Mat> read_image_with_alpha(const std::filesystem::path& path);
/// As read_image, converted to one 8-bit grey channel.
Result<cv::Mat> read_grey_image(const std::filesystem::path& path);
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
