#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct CheckOptions {
  std::vector<std::filesystem::path> files;  ///< limn.check/1; empty: all of config/checks.
  std::filesystem::path out = "out/check";
  bool json = false;  ///< Prints check.json instead of a table.
  /// The `out` of another run of the same checks, for instance on another machine; empty: none. Its images
  /// may differ by two levels, and by more in 0.1 % of an image's pixels.
  std::filesystem::path against;
};

/// `limn check`: renders what each check file asks for and compares it with the ray tracer. Prints a table of
/// measured values, limits and verdicts; writes check.html, check.json and the images
/// CHECK/MEASURE-{actual,expected,difference}.png into `out`. Error when a check fails or none can be read.
Status run_check(const CheckOptions& options);

}  // namespace limn::apps
