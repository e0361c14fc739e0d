#pragma once

#include <string>
#include <vector>

#include "core/result.h"
#include "wizard/measure/deviation_files.h"

namespace limn::apps {

struct DeviationCommand {
  wizard::DeviationFilesOptions files = {};
  double tolerance_mm = 0.5, reach_mm = 5;
  double spacing_mm = 0;       ///< 0: that of the scan
  bool no_align = false;       ///< Trusts the given pose.
  std::vector<double> fit_mm;  ///< x, y, z of two opposite corners; empty: none
  bool json = false;           ///< Prints deviation.json instead of lines.
};

/// `limn deviation`: calls write_deviation() and prints the result.
Status run_deviation(const DeviationCommand& command);

}  // namespace limn::apps
