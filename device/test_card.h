#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace limn::apps {

/// What a display shows of itself: its number (from 1) on the number's colour, its name and size, a line
/// around the edge, and a patch whose pixels take turns (grey and even where pixels are lit one by one, with
/// a pattern in it where something scales).
cv::Mat output_sign(cv::Size size, int number, const std::string& name);

/// The colour of a number, in a word.
const char* sign_colour(int number);

}  // namespace limn::apps
