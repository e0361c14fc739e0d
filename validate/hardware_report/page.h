#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "core/result.h"

namespace limn::validate {

/// Writes report.html beside the report.json that `report` is: one file with all numbers and small images,
/// what is odd first. `folder` has the captures and the session that the images come from; absent ones are
/// left out.
Status write_report_page(const nlohmann::ordered_json& report, const std::filesystem::path& folder);

}  // namespace limn::validate
