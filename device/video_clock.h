#pragma once

#include <optional>

#include "core/frame.h"

namespace limn::device {

/// Lays the times that a video stream's sender writes on frames (seconds, of any zero) onto the session's
/// clock: the frame that came with the least delay tells how the two are apart, and each frame's stamp is
/// when it would have come with that delay. So a frame that waited unread, or was held up, keeps its own
/// moment. The sender's clock may run off by k_drift.
class VideoClock {
 public:
  /// The moment of the frame that was read at `read_at`; never later.
  Stamp stamp(double sent_s, Stamp read_at) {
    const double delay_s = seconds_between(Stamp{}, read_at) - sent_s;
    if (last_sent_s_ && sent_s <= *last_sent_s_) least_delay_s_.reset();  // another stream, or no times in it
    if (least_delay_s_) *least_delay_s_ += k_drift * (sent_s - *last_sent_s_);
    if (!least_delay_s_ || delay_s < *least_delay_s_) least_delay_s_ = delay_s;
    last_sent_s_ = sent_s;
    return shifted(read_at, *least_delay_s_ - delay_s);
  }

 private:
  static constexpr double k_drift = 2e-4;  // quartz clocks differ by less: 0.2 ms in a second
  std::optional<double> least_delay_s_, last_sent_s_;
};

}  // namespace limn::device
