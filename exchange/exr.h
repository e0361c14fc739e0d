#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace limn::apps {

/// The bytes of an OpenEXR file of a CV_32FC3 image: its channels are R, G and B, 32-bit floats, zip
/// compressed, the top row first; `comment` says what they mean.
std::string exr_bytes(const cv::Mat& image, const std::string& comment);

}  // namespace limn::apps
