#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "core/result.h"
#include "validate/check_judge.h"

namespace limn::validate {

/// Writes one HTML file that needs no other: a table of all readings, those that use most of their limit
/// first, then the checks with their images.
Status write_check_page(std::span<const CheckResult> results,
                        const std::string& renderer,
                        const std::filesystem::path& path);

/// The readings as a table for a terminal, in the order of the checks.
std::string check_table(std::span<const CheckResult> results);

/// A value or limit as people read it: "0.123 mm", "0.42 %".
std::string readable_value(const CheckMeasure& measure, double value);

}  // namespace limn::validate
