#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "validate/check_file.h"

namespace limn::apps {

/// A measure with its verdict.
struct CheckReading {
  CheckLimit limit;
  double value = 0;
  bool good() const { return limit.measure.least ? value >= limit.value : value <= limit.value; }
  /// Share of the limit that is used up: above 1 it is missed. Orders readings of different measures.
  double strain() const;
};

/// What was drawn, what it should be, and how they differ, for people to look at (8-bit BGR).
struct CheckImage {
  std::string file;  ///< without -actual.png, -expected.png, -difference.png
  std::string title;
  std::string caption;
  cv::Mat actual, expected, difference;
};

struct CheckResult {
  std::string name;
  std::string about;
  std::vector<CheckReading> readings;  ///< in the order of check_measures()
  std::vector<CheckImage> images;
  double seconds = 0;
  std::string problem;  ///< why nothing was measured; empty: it was
  bool good() const;
};

}  // namespace limn::apps
