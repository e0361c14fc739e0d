#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

namespace limn {

/// A PNG of an 8- or 16-bit grey, BGR or BGRA image. `compression`: from 0 (large) to 9 (slow), with all of
/// libpng's filters; without it one filter and the fastest compression, which takes half the time of 1 for a
/// file that is up to a third larger.
std::string encode_png(const cv::Mat& image, std::optional<int> compression = {});

/// A JPEG of an 8-bit grey or BGR image; `quality` is from 1 to 100.
std::string encode_jpeg(const cv::Mat& image, int quality);

}  // namespace limn
