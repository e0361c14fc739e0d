#include "device/open_display.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "device/monitor_display.h"
#include "device/offscreen_display.h"
#include "device/window.h"

namespace limn::device {
namespace {

using Opened = Result<std::unique_ptr<Display>>;

// A display in a window: scaled to it, gone once the person closes it.
class WindowDisplay : public Display {
 public:
  WindowDisplay(Window window, const DisplayWanted& wanted) : window_(std::move(window)), wanted_(wanted) {}
  const std::string& name() const override { return wanted_.name; }
  cv::Size size() const override { return wanted_.size; }
  Result<Stamp> show(const cv::Mat& picture) override {
    LIMN_TRY_STATUS(fits(picture, wanted_.name, wanted_.size));
    if (!window_.is_open()) return error("{}: its window has been closed.", wanted_.name);
    window_.show(picture);
    return shifted(std::chrono::steady_clock::now(), wanted_.latency_s);
  }

 private:
  Window window_;
  DisplayWanted wanted_;
};

constexpr int k_window_width = 960;  // a larger one would hide the operator's

Opened open_window(const DisplayWanted& wanted, const Desktop& desktop) {
  const int width = std::min(wanted.size.width, k_window_width);
  LIMN_TRY(Window window, Window::open(desktop, {.title = wanted.name,
                                                 .width = width,
                                                 .height = width * wanted.size.height / wanted.size.width,
                                                 .waits = wanted.waits}));
  return Opened(std::make_unique<WindowDisplay>(std::move(window), wanted));
}

}  // namespace

bool needs_desktop(const DisplayWanted& wanted) { return wanted.monitor != "offscreen"; }

Result<std::unique_ptr<Display>> open_display(const DisplayWanted& wanted, const Desktop* desktop) {
  const bool monitor = wanted.monitor != "offscreen" && wanted.monitor != "window";
  if (!monitor && wanted.size.empty())
    return error("{}: expected a size for the display {}, found none. Give it, or a rig.", wanted.name,
                 wanted.monitor);
  if (wanted.monitor == "offscreen")
    return Opened(std::make_unique<OffscreenDisplay>(wanted.name, wanted.size, wanted.latency_s));
  if (!desktop)
    return error("{}: expected a desktop for the display {}, found none. Log in to a desktop or set DISPLAY.",
                 wanted.name, wanted.monitor);
  if (!monitor) return open_window(wanted, *desktop);
  LIMN_TRY(MonitorDisplay display, MonitorDisplay::open(*desktop, {.name = wanted.name,
                                                                   .monitor = wanted.monitor,
                                                                   .size = wanted.size,
                                                                   .latency_s = wanted.latency_s,
                                                                   .waits = wanted.waits}));
  return Opened(std::make_unique<MonitorDisplay>(std::move(display)));
}

}  // namespace limn::device
