#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "validate/hardware_report/finding.h"

namespace limn::validate {

/// System, release, processor, threads and memory of this machine.
nlohmann::ordered_json machine_json();

/// The doctor's tests as a list, and sentences about those that are odd.
nlohmann::ordered_json findings_json(std::span<const Finding> findings);
std::vector<std::string> odd_in(std::span<const Finding> findings);

}  // namespace limn::validate
