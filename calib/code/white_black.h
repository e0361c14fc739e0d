#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/result.h"

namespace limn::calib {

/// Images of white and of black, 8-bit grey.
struct WhiteBlack {
  cv::Mat white, black;
};

/// Computes white and black from a series of Gray code that lacks them. With inverses (`images` holds each
/// pattern and its inverse, widest stripes first within each axis): half the mean sum of the pairs, plus and
/// minus half of the upper quartile of their differences, which edges of stripes do not lower. Without: the
/// means of each pixel's bright and dark values. An unreadable image, or one of another size, is an error
/// that names it.
Result<WhiteBlack> white_black_of(const std::vector<std::filesystem::path>& images, bool inverses);

}  // namespace limn::calib
