#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "validate/demo_page.h"

namespace limn::validate {

/// What a demo measured, for people and for programs, and what it drew.
struct DemoResult {
  std::vector<DemoRow> rows;
  std::string json;  ///< The content of demo.json.
  std::vector<DemoImage> images;
};

/// Plays a whole session on the virtual rig `studio` and compares it with the simulator's ground truth:
/// captures (in `out`/demo-captures, removed afterwards unless `keep_captures`), calibration (in `out`/rig),
/// tracking, projection and composites. A GL context must be current.
Result<DemoResult> play_demo(const std::filesystem::path& out, bool keep_captures);

}  // namespace limn::validate
