#pragma once

#include <string>

namespace limn {

/// The current time in UTC, in whole seconds: "2026-01-31T12:00:00Z".
std::string time_now();

}  // namespace limn
