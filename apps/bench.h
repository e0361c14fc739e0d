#pragma once

#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct BenchOptions {
  std::string name;                    ///< tracker, id, calib, solve, projector, live, remote or tablet
  std::vector<std::string> arguments;  ///< Arguments for the bench.
};

/// Replaces this process by the bench program NAME_bench in tests/bench/ beside the running program. The
/// benches are separate programs because they link what they compare with (libapriltag, OpenCV's detector),
/// which the product must not link. Returns only when that fails.
Status run_bench(const BenchOptions& options);

}  // namespace limn::apps
