#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "device/desktop.h"

struct GLFWwindow;
struct GLFWmonitor;

namespace limn::device {

/// A GLFW window with one image in it, scaled to fit with black bars. GLFW must be there (Desktop). Its own
/// GL context is current only inside its functions; what was current before is current again after.
class GlfwSurface {
 public:
  struct Options {
    std::string title;
    int width = 0, height = 0;
    GLFWmonitor* monitor = nullptr;  ///< full screen on it, in the mode it is in
    int refresh_hz = 0;              ///< of that mode; another one of its size would be set
    bool vsync = true;               ///< for the monitor's next refresh at each swap
  };
  static Result<GlfwSurface> open(const Options& options);
  GlfwSurface(GlfwSurface&& other) noexcept;
  GlfwSurface& operator=(GlfwSurface&& other) noexcept;
  ~GlfwSurface();

  /// Uploads an 8-bit grey or BGR image and draws it. With `finished`, waits until the driver has swapped.
  void show(const cv::Mat& image, bool wait_for_swap = false);
  void redraw() const;
  /// Calls `paint` with its context current and its framebuffer bound, then swaps.
  void draw_with(const std::function<void(cv::Size pixels)>& paint) const;
  /// Calls `work` with its context current.
  void in_context(const std::function<void()>& work) const;
  /// Pixels that it draws on.
  cv::Size pixels() const;
  GLFWwindow* window() const { return window_; }

 private:
  GlfwSurface() = default;
  void upload(const cv::Mat& image);
  void draw() const;
  GLFWwindow* window_ = nullptr;
  unsigned texture_ = 0, framebuffer_ = 0;
  cv::Size size_;  // of the image
};

/// What GLFW complained of last.
std::string glfw_problem();

/// The monitors that are plugged in now (Desktop::monitors()), and what GLFW calls them until the next event.
std::vector<std::pair<Monitor, GLFWmonitor*>> list_monitors();

}  // namespace limn::device
