#pragma once

#include <chrono>

#include "core/frame.h"

namespace limn {

/// Wall time since `begun`.
inline double milliseconds_since(Stamp begun) {
  return 1e3 * seconds_between(begun, std::chrono::steady_clock::now());
}

}  // namespace limn
