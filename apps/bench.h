#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct BenchOptions {
  std::string name;                    ///< tracker, id, calib, solve, projector, live, remote or tablet
  std::vector<std::string> arguments;  ///< Arguments for the bench.
};

/// The names of all benches.
std::span<const std::string_view> bench_names();

/// Replaces this process by the bench program NAME_bench in tests/bench/ beside the running program. The
/// benches are separate programs because they link what they compare with (libapriltag, OpenCV's detector),
/// which the product must not link. Returns only when that fails.
Status run_bench(const BenchOptions& options);

}  // namespace limn::apps
