#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/judge/faults.h"
#include "core/result.h"

namespace limn::calib {

/// Writes report.json for captures whose solve failed: verdict `reject`, `failure` (the solve's message) and
/// the faults that explain it. If the folder holds a rig, that rig's report is kept.
Status write_failed_report(const std::string& failure,
                           const std::vector<Fault>& faults,
                           const std::filesystem::path& folder);

}  // namespace limn::calib
