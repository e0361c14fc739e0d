#pragma once

#include <algorithm>
#include <optional>

#include "core/frame.h"

namespace limn::apps {

/// Puts a camera's stamps on the session's clock: those of a clock of its own (a video's, a camera's that was
/// set wrong) are moved so that the first is now. A clock that steps is moved anew, so that its images are
/// on their way for as long as they were before.
class SourceClock {
 public:
  struct Time {
    Stamp captured_at;         ///< on the session's clock
    bool has_stepped = false;  ///< this stamp did not fit to those before
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

  /// Whether it is another clock than the session's: such sources are played at their pace.
  bool is_other() const { return offset_s_ && *offset_s_ != 0; }

 private:
  // No camera's image is from later than a moment from now, or is so long on its way.
  static constexpr double k_ahead_s = 2, k_behind_s = 5;
  std::optional<double> offset_s_;
  double behind_s_ = 0;  // as the newest that fitted was
};

}  // namespace limn::apps
