#pragma once

#include <functional>

#include "core/frame.h"
#include "core/result.h"

namespace limn::apps {

/// A display and a camera that sees its light, for flashes.
struct FlashStage {
  /// Shows all white or all black; returns the moment that the latency is counted from.
  std::function<Result<Stamp>(bool white)> show;
  std::function<Result<Frame>()> next;       ///< the camera's next frame, with an honest captured_at
  std::function<void(double seconds)> wait;  ///< lets time pass
};

struct FlashOptions {
  int flashes = 24;      ///< each at another moment between two frames; more is finer and takes longer
  double limit_s = 0.5;  ///< a longer latency is not looked for
};

struct DisplayLatency {
  double seconds = 0;   ///< from the moment of show to light, on the camera's clock
  double within_s = 0;  ///< half the span of what the flashes allow
  int flashes = 0;      ///< that agree, of those shown
};

/// Measures how long a display's light takes. A flash was lit between the last dark frame and the first
/// bright one; flashes at different moments between frames narrow that down to a fraction of the frame
/// period. Where they disagree (a display that waits for its refresh), the latency that most of them allow.
/// Half brightness counts as lit: it is what a frame shows whose exposure the light divides in halves. Error:
/// the camera does not see the light, or fewer than half of the flashes agree.
Result<DisplayLatency> measured_latency(const FlashStage& stage, const FlashOptions& options = {});

}  // namespace limn::apps
