#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "core/result.h"

// OpenCV's marker dictionaries and its detector. They are in a shared library of their own
// (core/opencv_markers/), because OpenCV's module for them, which needs its neural networks and protobuf,
// would lengthen every start of the program.

namespace limn {

/// A dictionary: square markers of cells x cells cells inside a dark border.
struct OpencvDictionary {
  int number = 0;                    ///< OpenCV's, cv::aruco::DICT_…
  int cells = 0;                     ///< along a side, without the border
  std::vector<std::uint64_t> codes;  ///< by the id: cells row by row, the first is the highest bit; 1: light
};

/// The markers that OpenCV's detector found, in pixels. The corners run clockwise from the marker's top left.
struct OpencvMarkers {
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
};

/// The dictionary with OpenCV's number (PredefinedFamily::opencv_dictionary). Loads the shared library at the
/// first call. Error: it is not there, or a library that it needs is not installed.
Result<OpencvDictionary> opencv_dictionary(int number);

/// A marker's image with a border of one cell, 8-bit grey, square. The side is a multiple of its cells.
cv::Mat opencv_marker_image(const OpencvDictionary& dictionary, int id, int side_px);

/// Finds a dictionary's markers, whose dark border is `border_cells` wide.
OpencvMarkers find_opencv_markers(const cv::Mat& grey,
                                  const OpencvDictionary& dictionary,
                                  int border_cells = 1);

/// What the shared library gives to the program.
struct OpencvFunctions {
  OpencvDictionary (*dictionary)(int number);
  OpencvMarkers (*find_markers)(const cv::Mat& grey, int number, int border_cells);
};

}  // namespace limn
