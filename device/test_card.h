#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace limn::device {

/// A test image that identifies a display: its number (from 1) on the number's colour, its name and size, a
/// line around the edge, and a checkerboard of single pixels, which looks evenly grey unless something scales
/// the image.
cv::Mat output_sign(cv::Size size, int number, const std::string& name);

/// The name of a number's colour.
const char* sign_colour(int number);

}  // namespace limn::device
