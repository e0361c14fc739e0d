#pragma once

#include <optional>

#include "core/frame.h"

namespace limn::device {

/// Converts the frame times of a video stream's sender (seconds, with any zero) to the session's clock. The
/// frame with the least delay gives the offset between the clocks; each frame's stamp is its arrival with
/// that delay. So the stamp of a frame that waited unread or was delayed is still correct. The sender's clock
/// may drift by k_drift.
class VideoClock {
 public:
  /// The stamp of a frame that was read at `read_at`; never later than that.
  Stamp stamp(double sent_s, Stamp read_at) {
    const double delay_s = seconds_between(Stamp{}, read_at) - sent_s;
    if (last_sent_s_ && sent_s <= *last_sent_s_)
      least_delay_s_.reset();  // a new stream, or one without times
    if (least_delay_s_) *least_delay_s_ += k_drift * (sent_s - *last_sent_s_);
    if (!least_delay_s_ || delay_s < *least_delay_s_) least_delay_s_ = delay_s;
    last_sent_s_ = sent_s;
    return shifted(read_at, *least_delay_s_ - delay_s);
  }

 private:
  static constexpr double k_drift = 2e-4;  // 0.2 ms per second; quartz clocks differ by less
  std::optional<double> least_delay_s_, last_sent_s_;
};

}  // namespace limn::device
