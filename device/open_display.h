#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/enum_names.h"
#include "core/stereo.h"
#include "core/wall.h"
#include "device/desktop.h"
#include "device/display.h"

namespace limn::device {

/// What shows a display's images.
enum class DisplayKind {
  monitor,   ///< A monitor of the desktop, full screen.
  window,    ///< A window of any size.
  offscreen  ///< Nothing: no light.
};
inline constexpr EnumNames<DisplayKind, 3> k_display_kinds{{"monitor", "window", "offscreen"}};

/// The configuration of a display.
struct DisplayConfig {
  std::string name = "projector0";
  std::string host = {};  ///< The machine of the room that it is plugged into; empty: this one.
  DisplayKind kind = DisplayKind::monitor;
  std::string monitor = {};  ///< The monitor's name on the desktop; other kinds have none.
  cv::Size size = {};        ///< Size of the images, the rig's. Empty, for a monitor only: its present mode.
  double latency_s = 0;      ///< Measured time from the swap to light.
  bool vsync = true;  ///< Each image waits for the next refresh; enable it on only one of several displays.
  StereoLayout stereo = StereoLayout::off;
  std::optional<Wall> wall = {};  ///< Where a screen stands in the world; nullopt: anywhere.
};

/// What shows the display's images, as a devices file writes it: the monitor's name, `window` or `offscreen`.
std::string to_text(const DisplayConfig& config);
/// Whether the display needs this machine's desktop.
bool needs_desktop(const DisplayConfig& config);

/// Opens the display; `desktop` may be null for an offscreen one. Errors: no desktop, no such monitor, a
/// monitor in another mode, no size, no framebuffer for two eyes (StereoLayout::quad_buffer).
Result<std::unique_ptr<Display>> open_display(const DisplayConfig& config, const Desktop* desktop);

}  // namespace limn::device
