#pragma once

#include "core/opencv_markers.h"

namespace limn {

/// What the shared library with OpenCV's markers gives to the program.
struct OpencvFunctions {
  OpencvDictionary (*dictionary)(int number);
  OpencvMarkers (*find_markers)(const cv::Mat& grey, int number, int border_cells);
};

}  // namespace limn
