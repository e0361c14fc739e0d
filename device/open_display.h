#pragma once

#include <memory>

#include "device/desktop.h"
#include "device/display.h"

namespace limn::device {

/// A display as people write it down.
struct DisplayConfig {
  std::string name = "projector0";
  std::string monitor;   ///< its name on the desktop; `window`: a window of any size; `offscreen`: no light
  cv::Size size = {};    ///< of the images, the rig's; empty only for a monitor: as it stands
  double latency_s = 0;  ///< measured, from the swap to light
  bool vsync = true;     ///< for the next refresh at each image; of several, let one wait
};

/// Whether it needs a desktop.
bool needs_desktop(const DisplayConfig& config);

/// Opens it; `desktop` may be null for `offscreen`. Errors: no desktop, no such monitor, a monitor in another
/// mode, no size.
Result<std::unique_ptr<Display>> open_display(const DisplayConfig& config, const Desktop* desktop);

}  // namespace limn::device
