#include "device/open_display.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "device/monitor_display.h"
#include "device/offscreen_display.h"
#include "device/stereo_display.h"
#include "device/window.h"

namespace limn::device {
namespace {

using Opened = Result<std::unique_ptr<Display>>;

// A display in a window: images are scaled to it; it ends when the person closes the window.
class WindowDisplay : public Display {
 public:
  WindowDisplay(Window window, const DisplayConfig& config) : window_(std::move(window)), config_(config) {}
  const std::string& name() const override { return config_.name; }
  cv::Size size() const override { return config_.size; }
  Result<Stamp> show(const cv::Mat& image) override { return show_eyes({image}); }
  bool is_stereo() const override { return config_.stereo == StereoLayout::quad_buffer; }
  Result<Stamp> show_eyes(const EyeImages& images) override {
    LIMN_TRY_STATUS(check_image(images.left, config_.name, config_.size));
    if (images.is_stereo()) LIMN_TRY_STATUS(check_image(images.right, config_.name, config_.size));
    if (!window_.is_open()) return error("{}: its window has been closed.", config_.name);
    if (is_stereo())
      window_.show_eyes(images);
    else
      window_.show(images.left);
    return shifted(std::chrono::steady_clock::now(), config_.latency_s);
  }

 private:
  Window window_;
  DisplayConfig config_;
};

constexpr int k_window_width = 960;  // a larger window would hide the operator's

Opened open_window(const DisplayConfig& config, const Desktop& desktop) {
  const int width = std::min(config.size.width, k_window_width);
  LIMN_TRY(Window window, Window::open(desktop, {.title = config.name,
                                                 .width = width,
                                                 .height = width * config.size.height / config.size.width,
                                                 .vsync = config.vsync,
                                                 .quad_buffer = config.stereo == StereoLayout::quad_buffer}));
  return Opened(std::make_unique<WindowDisplay>(std::move(window), config));
}

// Opens what shows the images, without the layouts that need nothing of it.
Opened open_surface(const DisplayConfig& config, const Desktop* desktop) {
  if (config.kind != DisplayKind::monitor && config.size.empty())
    return error("{}: expected a size for the display {}, found none. Give a size or a rig.", config.name,
                 to_text(config));
  if (config.kind == DisplayKind::offscreen && config.stereo == StereoLayout::quad_buffer)
    return error("{}: expected a monitor or a window for quad_buffer, found offscreen.", config.name);
  if (config.kind == DisplayKind::offscreen)
    return Opened(std::make_unique<OffscreenDisplay>(config.name, config.size, config.latency_s));
  if (!desktop)
    return error("{}: expected a desktop for the display {}, found none. Log in to a desktop or set DISPLAY.",
                 config.name, to_text(config));
  if (config.kind == DisplayKind::window) return open_window(config, *desktop);
  LIMN_TRY(MonitorDisplay display,
           MonitorDisplay::open(*desktop, {.name = config.name,
                                           .monitor = config.monitor,
                                           .size = config.size,
                                           .latency_s = config.latency_s,
                                           .vsync = config.vsync,
                                           .quad_buffer = config.stereo == StereoLayout::quad_buffer}));
  return Opened(std::make_unique<MonitorDisplay>(std::move(display)));
}

}  // namespace

std::string to_text(const DisplayConfig& config) {
  return config.kind == DisplayKind::monitor ? config.monitor : k_display_kinds.text(config.kind);
}

bool needs_desktop(const DisplayConfig& config) {
  return config.host.empty() && config.kind != DisplayKind::offscreen;
}

Result<std::unique_ptr<Display>> open_display(const DisplayConfig& config, const Desktop* desktop) {
  LIMN_TRY(std::unique_ptr<Display> display, open_surface(config, desktop));
  if (config.stereo == StereoLayout::off || display->is_stereo()) return Opened(std::move(display));
  return Opened(std::make_unique<StereoDisplay>(std::move(display), config.stereo));
}

}  // namespace limn::device
