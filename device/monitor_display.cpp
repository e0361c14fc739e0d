#include "device/monitor_display.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <chrono>
#include <optional>
#include <utility>

#include "device/glfw_surface.h"
#include "device/offscreen_display.h"

namespace limn::device {
namespace {

using Handle = std::pair<Monitor, GLFWmonitor*>;

// The monitor of that name, in a mode of that size (empty: any size).
Result<Handle> found_monitor(const MonitorDisplayOptions& options) {
  std::string others;
  for (const Handle& found : list_monitors()) {
    const cv::Size size = found.first.size;
    if (found.first.name == options.monitor && (options.size.empty() || size == options.size)) return found;
    if (found.first.name == options.monitor)
      return error(
          "{}: expected the monitor {} in the rig's mode {}x{}, found it in {}x{}. Set that mode in the "
          "desktop's settings, or calibrate this one.",
          options.name, options.monitor, options.size.width, options.size.height, size.width, size.height);
    others += fmt::format(" {} ({}x{})", found.first.name, size.width, size.height);
  }
  return error("{}: expected the monitor {}, found{}. Plug it in and switch it on, or change its name.",
               options.name, options.monitor, others.empty() ? " none" : others);
}

}  // namespace

struct MonitorDisplay::Impl {
  MonitorDisplayOptions options;
  Desktop desktop;
  std::optional<GlfwSurface> surface;  // none while the monitor is unplugged

  Status begin(const Handle& monitor);
  Result<Stamp> show(const EyeImages& images);
};

Status MonitorDisplay::Impl::begin(const Handle& monitor) {
  const cv::Size size = monitor.first.size;
  LIMN_TRY(surface, GlfwSurface::open({.title = options.name,
                                       .width = size.width,
                                       .height = size.height,
                                       .monitor = monitor.second,
                                       .refresh_hz = monitor.first.refresh_hz,
                                       .vsync = options.vsync,
                                       .quad_buffer = options.quad_buffer}));
  glfwSetInputMode(surface->window(), GLFW_CURSOR, GLFW_CURSOR_HIDDEN);
  glfwPollEvents();
  const cv::Size pixels = surface->pixels();
  if (pixels == size) return {};
  surface.reset();
  return error(
      "{}: expected {}x{} pixels on the monitor {}, the desktop gives {}x{}. Switch its scaling off.",
      options.name, size.width, size.height, options.monitor, pixels.width, pixels.height);
}

Result<Stamp> MonitorDisplay::Impl::show(const EyeImages& images) {
  LIMN_TRY_STATUS(check_image(images.left, options.name, options.size));
  if (images.is_stereo()) LIMN_TRY_STATUS(check_image(images.right, options.name, options.size));
  const auto monitor = found_monitor(options);
  // A window whose monitor is gone would appear on another one.
  if (!monitor || (surface && glfwGetWindowMonitor(surface->window()) != monitor->second)) surface.reset();
  if (!monitor) return monitor.error();
  if (!surface) LIMN_TRY_STATUS(begin(*monitor));
  if (options.quad_buffer)
    surface->show_eyes(images, true);
  else
    surface->show(images.left, true);
  return shifted(std::chrono::steady_clock::now(), options.latency_s);
}

MonitorDisplay::MonitorDisplay(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MonitorDisplay::MonitorDisplay(MonitorDisplay&&) noexcept = default;
MonitorDisplay& MonitorDisplay::operator=(MonitorDisplay&&) noexcept = default;
MonitorDisplay::~MonitorDisplay() = default;

Result<MonitorDisplay> MonitorDisplay::open(const Desktop& desktop, const MonitorDisplayOptions& options) {
  auto impl = std::make_unique<Impl>(Impl{options, desktop, std::nullopt});
  LIMN_TRY(const Handle monitor, found_monitor(options));
  impl->options.size = monitor.first.size;
  LIMN_TRY_STATUS(impl->begin(monitor));
  return MonitorDisplay(std::move(impl));
}

const std::string& MonitorDisplay::name() const { return impl_->options.name; }
cv::Size MonitorDisplay::size() const { return impl_->options.size; }
Result<Stamp> MonitorDisplay::show(const cv::Mat& image) { return impl_->show({image}); }
bool MonitorDisplay::is_stereo() const { return impl_->options.quad_buffer; }
Result<Stamp> MonitorDisplay::show_eyes(const EyeImages& images) { return impl_->show(images); }

}  // namespace limn::device
