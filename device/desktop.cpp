#include "device/desktop.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>

#include "device/glfw_surface.h"

namespace limn::device {
namespace {

Monitor described(GLFWmonitor* monitor) {
  Monitor found;
  found.name = glfwGetMonitorName(monitor);
  if (const GLFWvidmode* mode = glfwGetVideoMode(monitor)) {
    found.size = {mode->width, mode->height};
    found.refresh_hz = mode->refreshRate;
  }
  found.largest = found.size;
  int count = 0;
  const GLFWvidmode* modes = glfwGetVideoModes(monitor, &count);
  for (int i = 0; i < count; ++i)
    if (modes[i].width * modes[i].height > found.largest.area())
      found.largest = {modes[i].width, modes[i].height};
  glfwGetMonitorPos(monitor, &found.position.x, &found.position.y);
  return found;
}

}  // namespace

// Ends GLFW when the last copy is destroyed.
struct Desktop::Impl {
  Impl() = default;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() { glfwTerminate(); }
};

Result<Desktop> Desktop::open() {
  glfwGetError(nullptr);
  glfwGetPrimaryMonitor();  // fails when GLFW is not initialised, so no flag of our own is needed
  if (glfwGetError(nullptr) != GLFW_NOT_INITIALIZED)
    return error(
        "desktop: expected to be the only one in this program, found another. Pass that one on instead.");
#ifdef GLFW_PLATFORM_X11
  // Since 3.4 GLFW prefers Wayland, where no program may place its windows on monitors; on X11 it may.
  glfwInitHint(GLFW_PLATFORM, GLFW_PLATFORM_X11);
#endif
  if (!glfwInit()) {
    return error("desktop: expected a display, found none ({}). Log in to a desktop or set DISPLAY.",
                 glfw_problem());
  }
  return Desktop(std::make_shared<Impl>());
}

std::vector<std::pair<Monitor, GLFWmonitor*>> list_monitors() {
  glfwPollEvents();  // updates the list of monitors
  int count = 0;
  GLFWmonitor** list = glfwGetMonitors(&count);
  std::vector<std::pair<Monitor, GLFWmonitor*>> monitors;
  for (int i = 0; i < count; ++i) monitors.emplace_back(described(list[i]), list[i]);
  std::stable_sort(monitors.begin(), monitors.end(), [](const auto& a, const auto& b) {
    return std::pair(a.first.position.x, a.first.position.y) <
           std::pair(b.first.position.x, b.first.position.y);
  });
  for (std::size_t i = 0; i < monitors.size(); ++i) {
    const std::string name = monitors[i].first.name;
    int seen = 1;
    for (std::size_t j = i + 1; j < monitors.size(); ++j)
      if (monitors[j].first.name == name) monitors[j].first.name = fmt::format("{}#{}", name, ++seen);
  }
  return monitors;
}

std::vector<Monitor> Desktop::monitors() const {
  std::vector<Monitor> found;
  for (const auto& [monitor, handle] : list_monitors()) found.push_back(monitor);
  return found;
}

std::optional<Monitor> Desktop::find(const std::string& name) const {
  for (const Monitor& monitor : monitors())
    if (monitor.name == name) return monitor;
  return std::nullopt;
}

}  // namespace limn::device
