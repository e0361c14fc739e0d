#pragma once

#include <algorithm>
#include <optional>

#include "core/frame.h"

namespace limn::device {

/// Converts a camera's stamps to the session's clock. Stamps of another clock (a video's, or a camera clock
/// that is set wrong) are shifted so that the first one is now. When a clock steps, the shift is chosen again
/// so that images have the same delay as before.
class SourceClock {
 public:
  struct Time {
    Stamp captured_at;         ///< on the session's clock
    bool has_stepped = false;  ///< this stamp does not fit the ones before
  };

  Time on_session_clock(Stamp captured_at, Stamp now) {
    const double behind_s = seconds_between(shifted(captured_at, offset_s_.value_or(0)), now);
    const bool fits = behind_s > -k_ahead_s && behind_s < k_behind_s;
    const bool has_stepped = offset_s_ && !fits;
    if (!fits) offset_s_ = seconds_between(captured_at, now) - behind_s_;
    if (!offset_s_) offset_s_ = 0;
    if (fits) behind_s_ = std::max(0.0, behind_s);
    return {shifted(captured_at, *offset_s_), has_stepped};
  }

  /// Whether it is another clock than the session's: such sources are played at their own pace.
  bool is_other() const { return offset_s_ && *offset_s_ != 0; }

 private:
  // A stamp fits if its image is less than k_ahead_s in the future and less than k_behind_s late.
  static constexpr double k_ahead_s = 2, k_behind_s = 5;
  std::optional<double> offset_s_;
  double behind_s_ = 0;  // delay of the newest stamp that fitted
};

}  // namespace limn::device
