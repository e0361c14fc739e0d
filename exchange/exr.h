#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace limn::exchange {

/// The bytes of an OpenEXR file for a CV_32FC3 image: channels R, G and B, 32-bit floats, zip compressed, top
/// row first. `comment` is stored in the file and says what the channels mean.
std::string exr_bytes(const cv::Mat& image, const std::string& comment);

}  // namespace limn::exchange
