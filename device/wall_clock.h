#pragma once

#include <chrono>

#include "core/frame.h"

namespace limn::device {

/// Converts the wall clock's moment `since_epoch` to the monotonic clock. If it is in the future or more than
/// `oldest_s` ago, the wall clock was set in between, and the current moment is returned instead. If the
/// process was interrupted between reading the two clocks, both are read again, because the result would be
/// too early.
inline Stamp from_wall_clock(std::chrono::nanoseconds since_epoch, double oldest_s) {
  constexpr double k_at_once_s = 50e-6;
  Stamp read_at;
  double age_s = 0;
  for (int i = 0; i < 10; ++i) {
    read_at = now();
    const auto age = std::chrono::system_clock::now().time_since_epoch() - since_epoch;
    age_s = std::chrono::duration<double>(age).count();
    if (seconds_between(read_at, now()) < k_at_once_s) break;
  }
  return age_s >= 0 && age_s < oldest_s ? shifted(read_at, -age_s) : read_at;
}

}  // namespace limn::device
