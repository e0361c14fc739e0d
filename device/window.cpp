#include "device/window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <utility>

#include "device/glfw_surface.h"

namespace limn::device {

struct Window::Impl {
  Desktop desktop;  // destroyed last
  GlfwSurface surface;
  bool escape_closes = true;
  int key = 0;
  WindowInput input = {};
  std::array<bool, 3> held = {};

  void listen();
  static Impl& of(GLFWwindow* window) { return *static_cast<Impl*>(glfwGetWindowUserPointer(window)); }
};

// From now on events are collected in `input`; this object must not move any more.
void Window::Impl::listen() {
  GLFWwindow* const window = surface.window();
  glfwSetWindowUserPointer(window, this);
  glfwSetKeyCallback(window, [](GLFWwindow* from, int key, int, int action, int) {
    Impl& impl = of(from);
    impl.input.keys.push_back({key, action != GLFW_RELEASE});
    if (action != GLFW_PRESS) return;
    impl.key = key;
    if (key == GLFW_KEY_ESCAPE && impl.escape_closes) glfwSetWindowShouldClose(from, GLFW_TRUE);
  });
  glfwSetCharCallback(
      window, [](GLFWwindow* from, unsigned character) { of(from).input.characters.push_back(character); });
  glfwSetCursorPosCallback(window, [](GLFWwindow* from, double x, double y) {
    int width = 0, height = 0;
    glfwGetWindowSize(from, &width, &height);
    const cv::Size pixels = of(from).surface.pixels();
    if (width <= 0 || height <= 0) return;
    of(from).input.pointer = {static_cast<float>(x * pixels.width / width),
                              static_cast<float>(y * pixels.height / height)};
  });
  glfwSetCursorEnterCallback(window, [](GLFWwindow* from, int entered) {
    if (!entered) of(from).input.pointer = {-1, -1};
  });
  glfwSetMouseButtonCallback(window, [](GLFWwindow* from, int button, int action, int) {
    if (button < 0 || button >= 3) return;
    const auto i = static_cast<std::size_t>(button);
    of(from).held[i] = action == GLFW_PRESS;
    if (action == GLFW_PRESS) of(from).input.buttons[i] = true;
  });
  glfwSetScrollCallback(
      window, [](GLFWwindow* from, double, double up) { of(from).input.wheel += static_cast<float>(up); });
}

Window::Window(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Window::Window(Window&&) noexcept = default;
Window& Window::operator=(Window&&) noexcept = default;
Window::~Window() = default;

Result<Window> Window::open(const std::string& title, int width, int height) {
  LIMN_TRY(const Desktop desktop, Desktop::open());
  return open(desktop, {.title = title, .width = width, .height = height});
}

Result<Window> Window::open(const Desktop& desktop, const WindowOptions& options) {
  LIMN_TRY(GlfwSurface surface, GlfwSurface::open({.title = options.title,
                                                   .width = options.width,
                                                   .height = options.height,
                                                   .vsync = options.vsync,
                                                   .quad_buffer = options.quad_buffer}));
  auto impl = std::make_unique<Impl>(Impl{desktop, std::move(surface), options.escape_closes});
  impl->listen();
  return Window(std::move(impl));
}

void Window::show(const cv::Mat& image) {
  impl_->surface.show(image);
  glfwPollEvents();
}

void Window::show_eyes(const EyeImages& images) {
  impl_->surface.show_eyes(images);
  glfwPollEvents();
}

bool Window::is_open() {
  glfwPollEvents();
  if (!is_wanted()) return false;
  impl_->surface.redraw();
  return true;
}

int Window::poll_pressed_key() { return std::exchange(impl_->key, 0); }

void Window::draw(const std::function<void(cv::Size)>& paint) { impl_->surface.draw_with(paint); }
void Window::in_context(const std::function<void()>& work) { impl_->surface.in_context(work); }

WindowInput Window::input() {
  glfwPollEvents();
  WindowInput now = std::exchange(impl_->input, {});
  impl_->input.pointer = now.pointer;
  impl_->input.buttons = impl_->held;
  return now;
}

bool Window::is_wanted() const { return !glfwWindowShouldClose(impl_->surface.window()); }

bool Window::is_minimised() const {
  return glfwGetWindowAttrib(impl_->surface.window(), GLFW_ICONIFIED) == GLFW_TRUE;
}

float Window::scale() const {
  float x = 1, y = 1;
  glfwGetWindowContentScale(impl_->surface.window(), &x, &y);
  return std::max(x, y);
}

}  // namespace limn::device
