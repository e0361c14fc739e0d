#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace limn {

/// The text with HTML's special characters escaped.
std::string escaped(const std::string& text);

/// The image, made smaller if it is wider than `width` pixels.
cv::Mat at_most_wide(const cv::Mat& image, int width);

}  // namespace limn
