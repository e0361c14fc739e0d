#pragma once

#include <algorithm>
#include <optional>

#include "core/frame.h"

namespace limn::nodes {

/// Limits how many bytes go through in a second. What was not used is saved, up to a burst.
class TokenBucket {
 public:
  TokenBucket(double bytes_per_s, double burst_bytes)
      : bytes_per_s_(bytes_per_s), burst_bytes_(burst_bytes), saved_bytes_(burst_bytes) {}

  /// Takes that many bytes; returns for how long (s) whoever asks must wait before they go through.
  double delay_s(double bytes, Stamp now) {
    if (taken_at_) saved_bytes_ += bytes_per_s_ * std::max(0.0, seconds_between(*taken_at_, now));
    taken_at_ = now;
    saved_bytes_ = std::min(saved_bytes_, burst_bytes_) - bytes;
    return std::max(0.0, -saved_bytes_ / bytes_per_s_);
  }

 private:
  double bytes_per_s_, burst_bytes_;
  double saved_bytes_;  // negative: those that wait
  std::optional<Stamp> taken_at_;
};

}  // namespace limn::nodes
