#pragma once

#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct BenchOptions {
  std::string name;                    ///< tracker, calib, projector, live, remote, tablet
  std::vector<std::string> arguments;  ///< passed on
};

/// Becomes the bench program NAME_bench that stands in tests/bench/ beside the running program. The benches
/// are programs of their own because they link what they compare with (libapriltag, OpenCV's detector), which
/// the product must not carry. Returns only when that fails.
Status run_bench(const BenchOptions& options);

}  // namespace limn::apps
