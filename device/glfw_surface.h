#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/result.h"
#include "core/stereo.h"
#include "device/desktop.h"

struct GLFWwindow;
struct GLFWmonitor;

namespace limn::device {

/// A GLFW window with one image in it, scaled to fit with black bars. GLFW must be initialised (Desktop). The
/// window's own GL context is current only inside its functions; afterwards the former context is current
/// again.
class GlfwSurface {
 public:
  struct Options {
    std::string title;
    int width = 0, height = 0;
    GLFWmonitor* monitor = nullptr;  ///< Full screen on this monitor, in its present mode; null: a window.
    int refresh_hz = 0;              ///< Refresh rate of that mode; another value would change the mode.
    bool vsync = true;               ///< Whether each swap waits for the monitor's next refresh.
    bool quad_buffer = false;        ///< With a framebuffer for each eye (OpenGL's stereo).
  };
  static Result<GlfwSurface> open(const Options& options);
  GlfwSurface(GlfwSurface&& other) noexcept;
  GlfwSurface& operator=(GlfwSurface&& other) noexcept;
  ~GlfwSurface();

  /// Uploads an 8-bit grey or BGR image and draws it. With `wait_for_swap` it waits until the driver has
  /// swapped.
  void show(const cv::Mat& image, bool wait_for_swap = false);
  /// The same with an image for each eye, on a surface with `quad_buffer`.
  void show_eyes(const EyeImages& images, bool wait_for_swap = false);
  /// Draws the image again; a surface with `quad_buffer` keeps what it shows.
  void redraw() const;
  /// Calls `paint` with the window's context current and its framebuffer bound, then swaps.
  void draw_with(const std::function<void(cv::Size pixels)>& paint) const;
  /// Calls `work` with the window's context current.
  void in_context(const std::function<void()>& work) const;
  /// Size of the framebuffer in pixels.
  cv::Size pixels() const;
  GLFWwindow* window() const { return window_; }

 private:
  GlfwSurface() = default;
  void upload(const cv::Mat& image);
  void draw() const;
  void draw_into_back_buffer() const;
  GLFWwindow* window_ = nullptr;
  unsigned texture_ = 0, framebuffer_ = 0;
  cv::Size size_;  // size of the image
  bool quad_buffer_ = false;
};

/// The text of GLFW's last error.
std::string glfw_problem();

/// The monitors that are plugged in now (Desktop::monitors()) with GLFW's handles, which are valid until the
/// next event.
std::vector<std::pair<Monitor, GLFWmonitor*>> list_monitors();

}  // namespace limn::device
