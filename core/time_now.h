#pragma once

#include <string>

namespace limn {

/// The moment in UTC to the second: "2026-01-31T12:00:00Z".
std::string time_now();

}  // namespace limn
