#pragma once

#include <memory>

#include "device/desktop.h"
#include "device/display.h"

namespace limn::device {

/// The configuration of a display.
struct DisplayConfig {
  std::string name = "projector0";
  std::string
      monitor;         ///< A monitor's name on the desktop, `window` (of any size) or `offscreen` (no light).
  cv::Size size = {};  ///< Size of the images, the rig's. Empty, for a monitor only: its present mode.
  double latency_s = 0;  ///< Measured time from the swap to light.
  bool vsync = true;  ///< Each image waits for the next refresh; enable it on only one of several displays.
};

/// Whether the display needs a desktop.
bool needs_desktop(const DisplayConfig& config);

/// Opens the display; `desktop` may be null for `offscreen`. Errors: no desktop, no such monitor, a monitor
/// in another mode, no size.
Result<std::unique_ptr<Display>> open_display(const DisplayConfig& config, const Desktop* desktop);

}  // namespace limn::device
