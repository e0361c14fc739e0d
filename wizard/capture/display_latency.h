#pragma once

#include <functional>

#include "core/frame.h"
#include "core/result.h"

namespace limn::wizard {

/// A display that flashes, and a camera that sees its light.
struct FlashDevices {
  /// Shows all white or all black; returns the moment from which the latency counts.
  std::function<Result<Stamp>(bool white)> show;
  std::function<Result<Frame>()> next;       ///< the camera's next frame, with a correct captured_at
  std::function<void(double seconds)> wait;  ///< waits this long
};

struct FlashOptions {
  int flashes = 24;      ///< at different moments between two frames; more are more accurate and take longer
  double limit_s = 0.5;  ///< longest latency that can be measured
};

struct DisplayLatency {
  double seconds = 0;   ///< from show() to light, on the camera's clock
  double within_s = 0;  ///< half the width of the interval that the flashes allow
  int flashes = 0;      ///< number of flashes that agree
};

/// Measures the time from show() until the display's light appears. Light appears between the last dark frame
/// and the first bright one; flashes at different moments between frames narrow this interval to a fraction
/// of the frame period. If they disagree (a display that waits for its refresh), the latency that most of
/// them allow is returned. A frame counts as bright from half brightness on: then the light has appeared at
/// the middle of its exposure, which is its stamp. Error: the camera does not see the light, or fewer than
/// half of the flashes agree.
Result<DisplayLatency> measure_latency(const FlashDevices& devices, const FlashOptions& options = {});

}  // namespace limn::wizard
