#include "device/window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <utility>

#include "device/glfw_surface.h"

namespace limn::device {

struct Window::Impl {
  Desktop desktop;  // goes last
  GlfwSurface surface;
  int key = 0;
};

Window::Window(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Window::Window(Window&&) noexcept = default;
Window& Window::operator=(Window&&) noexcept = default;
Window::~Window() = default;

Result<Window> Window::open(const std::string& title, int width, int height) {
  LIMN_TRY(const Desktop desktop, Desktop::open());
  return open(desktop, title, width, height);
}

Result<Window> Window::open(const Desktop& desktop, const std::string& title, int width, int height) {
  LIMN_TRY(GlfwSurface surface, GlfwSurface::open({.title = title, .width = width, .height = height}));
  auto impl = std::make_unique<Impl>(Impl{desktop, std::move(surface)});
  glfwSetWindowUserPointer(impl->surface.window(), impl.get());
  glfwSetKeyCallback(impl->surface.window(), [](GLFWwindow* window, int key, int, int action, int) {
    if (action != GLFW_PRESS) return;
    static_cast<Impl*>(glfwGetWindowUserPointer(window))->key = key;
    if (key == GLFW_KEY_ESCAPE) glfwSetWindowShouldClose(window, GLFW_TRUE);
  });
  return Window(std::move(impl));
}

void Window::show(const cv::Mat& picture) {
  impl_->surface.show(picture);
  glfwPollEvents();
}

bool Window::is_open() {
  glfwPollEvents();
  if (glfwWindowShouldClose(impl_->surface.window())) return false;
  impl_->surface.redraw();
  return true;
}

int Window::pressed_key() { return std::exchange(impl_->key, 0); }

}  // namespace limn::device
