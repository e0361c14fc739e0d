#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/judge/faults.h"
#include "core/result.h"

namespace limn::calib {

/// report.json of captures that no rig came of: verdict `reject`, `failure` (the solve's message) and the
/// faults that explain it. Left alone where the folder holds a rig: that rig's report stays.
Status write_failed_report(const std::string& failure,
                           const std::vector<Fault>& faults,
                           const std::filesystem::path& folder);

}  // namespace limn::calib
