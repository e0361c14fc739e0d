#pragma once

#include <span>
#include <string>
#include <string_view>

namespace limn {

/// A marker family from OpenCV's predefined dictionaries.
struct PredefinedFamily {
  std::string_view name;  ///< OpenCV's name in lower case: `aruco_4x4_50`, `apriltag_36h11`.
  int opencv_dictionary;  ///< OpenCV's number, cv::aruco::DICT_…; for opencv_dictionary().
};

/// All predefined families.
std::span<const PredefinedFamily> predefined_families();

/// The family of that name; null when there is none.
const PredefinedFamily* find_predefined_family(std::string_view name);

}  // namespace limn
