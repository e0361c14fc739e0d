#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "validate/check_file.h"

namespace limn::validate {

/// A measured value with its limit.
struct CheckReading {
  CheckLimit limit;
  double value = 0;
  bool good() const { return limit.measure.least ? value >= limit.value : value <= limit.value; }
  /// The share of the limit that is used; above 1 the limit is missed. It orders readings of different
  /// measures.
  double limit_share() const;
};

/// What was drawn, what was expected, and the difference, for people (8-bit BGR).
struct CheckImage {
  std::string file;  ///< Without -actual.png, -expected.png, -difference.png.
  std::string title;
  std::string caption;
  cv::Mat actual, expected, difference;
};

struct CheckResult {
  std::string name;
  std::string about;
  std::vector<CheckReading> readings;  ///< In the order of check_measures().
  std::vector<CheckImage> images;
  double seconds = 0;
  std::string problem;  ///< Why nothing was measured; empty if there was no problem.
  bool good() const;
};

}  // namespace limn::validate
