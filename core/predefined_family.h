#pragma once

#include <span>
#include <string>
#include <string_view>

namespace limn {

/// A marker family that OpenCV's predefined dictionaries hold.
struct PredefinedFamily {
  std::string_view name;  ///< Limn's: OpenCV's in lower case, `aruco_4x4_50`, `apriltag_36h11`
  int opencv_dictionary;  ///< OpenCV's number, cv::aruco::PREDEFINED_DICTIONARY_NAME
};

/// All of them.
std::span<const PredefinedFamily> predefined_families();

/// The one of that name; null when there is none.
const PredefinedFamily* find_predefined_family(std::string_view name);

}  // namespace limn
