#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct CheckOptions {
  std::vector<std::filesystem::path> files;  ///< limn.check/1; none: all of config/checks
  std::filesystem::path out = "out/check";
  bool json = false;  ///< print check.json instead of a table
  /// `out` of another run of the same checks, on another machine perhaps; empty: none. What it drew may
  /// differ by two levels, and by more in 0.1 % of an image's pixels.
  std::filesystem::path against;
};

/// `limn check`: renders what each check file asks for and judges it against the ray tracer. Prints a table
/// of measured values, limits and verdicts; writes check.html, check.json and the images
/// CHECK/MEASURE-{actual,expected,difference}.png into `out`. Error when a check failed, or none could be
/// read.
Status run_check(const CheckOptions& options);

}  // namespace limn::apps
