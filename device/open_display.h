#pragma once

#include <memory>

#include "device/desktop.h"
#include "device/display.h"

namespace limn::device {

/// A display as people write it down.
struct DisplayWanted {
  std::string name = "projector0";
  std::string monitor;   ///< its name on the desktop; `window`: a window of any size; `offscreen`: no light
  cv::Size size = {};    ///< of the pictures, the rig's; empty only for a monitor: as it stands
  double latency_s = 0;  ///< measured, from the swap to light
  bool waits = true;     ///< for the next refresh at each picture; of several, let one wait
};

/// Whether it needs a desktop.
bool needs_desktop(const DisplayWanted& wanted);

/// Opens it; `desktop` may be null for `offscreen`. Errors: no desktop, no such monitor, a monitor in another
/// mode, no size.
Result<std::unique_ptr<Display>> open_display(const DisplayWanted& wanted, const Desktop* desktop);

}  // namespace limn::device
