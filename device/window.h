#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

#include "core/result.h"
#include "device/desktop.h"

namespace limn::device {

/// A window on the desktop that shows pictures, scaled to fit with black bars. Belongs to the main thread.
/// Its own GL context is current only inside its functions; what was current before is current again after.
class Window {
 public:
  /// Error without a display (GLFW needs X or Wayland), and while a Desktop is open: pass that one on.
  static Result<Window> open(const std::string& title, int width, int height);
  /// One of several on a desktop, beside monitors.
  static Result<Window> open(const Desktop& desktop, const std::string& title, int width, int height);
  Window(Window&&) noexcept;
  Window& operator=(Window&&) noexcept;
  ~Window();

  /// Shows an 8-bit grey or BGR picture from now on and handles pending events.
  void show(const cv::Mat& picture);
  /// Handles events and redraws; false once the person has closed the window or pressed Escape.
  bool is_open();
  /// The key pressed since the last call (GLFW's codes; letters are upper-case ASCII), 0 when none.
  int pressed_key();

 private:
  struct Impl;
  explicit Window(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
