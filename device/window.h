#pragma once

#include <array>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/desktop.h"

namespace limn::device {

struct WindowOptions {
  std::string title = "Limn";
  int width = 0, height = 0;
  bool vsync = true;          ///< for the monitor's next refresh at each image
  bool escape_closes = true;  ///< false: Escape is a key like any other
};

/// What a person did in a window since it was asked last.
struct WindowInput {
  struct Key {
    int code = 0;  ///< GLFW's; letters are upper-case ASCII
    bool is_down = false;
  };
  cv::Point2f pointer = {-1, -1};         ///< in the window's pixels; negative: outside
  std::array<bool, 3> buttons = {};       ///< left, right, middle: held, or pressed meanwhile
  float wheel = 0;                        ///< steps up
  std::vector<Key> keys = {};             ///< pressed (or repeated) and let go, in order
  std::vector<unsigned> characters = {};  ///< typed, Unicode
};

/// A window on the desktop that shows images, scaled to fit with black bars. Belongs to the main thread.
/// Its own GL context is current only inside its functions; what was current before is current again after.
class Window {
 public:
  /// Error without a display (GLFW needs X or Wayland), and while a Desktop is open: pass that one on.
  static Result<Window> open(const std::string& title, int width, int height);
  /// One of several on a desktop, beside monitors.
  static Result<Window> open(const Desktop& desktop, const WindowOptions& options);
  Window(Window&&) noexcept;
  Window& operator=(Window&&) noexcept;
  ~Window();

  /// Shows an 8-bit grey or BGR image from now on and handles pending events.
  void show(const cv::Mat& image);
  /// Handles events and redraws its image; false once the person has closed the window or pressed Escape.
  bool is_open();
  /// The key pressed since the last call (GLFW's codes; letters are upper-case ASCII), 0 when none.
  int poll_pressed_key();

  /// Calls `paint` with the window's context current and its framebuffer bound, then shows what it drew;
  /// instead of show().
  void draw(const std::function<void(cv::Size pixels)>& paint);
  /// Calls `work` with the window's context current: for what lives in it.
  void in_context(const std::function<void()>& work);
  /// Handles events; what was done since the last call.
  WindowInput input();
  /// False once the person has closed the window; nothing is drawn.
  bool is_wanted() const;
  /// Pixels of a desktop's ordinary one, as large as the person has set.
  float scale() const;

 private:
  struct Impl;
  explicit Window(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
