#pragma once

#include <chrono>

#include "core/frame.h"

namespace limn::device {

/// Where the wall clock's moment `since_epoch` lies on the monotonic clock. One that is to come, or more than
/// `oldest_s` ago, means that the wall clock was set meanwhile: it gives this moment instead. Both clocks are
/// read again when the process was held up between them, which would make everything seem to be earlier.
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
