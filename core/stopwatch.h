#pragma once

#include <chrono>

#include "core/frame.h"

namespace limn {

/// How long something took, by the wall.
inline double milliseconds_since(Stamp begun) {
  return 1e3 * seconds_between(begun, std::chrono::steady_clock::now());
}

}  // namespace limn
