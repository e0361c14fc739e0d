#pragma once

#include <array>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"
#include "core/stereo.h"
#include "device/desktop.h"

namespace limn::device {

struct WindowOptions {
  std::string title = "Limn";
  int width = 0, height = 0;
  bool vsync = true;          ///< Whether each image waits for the monitor's next refresh.
  bool escape_closes = true;  ///< If false, Escape is an ordinary key.
  bool quad_buffer = false;   ///< With a framebuffer for each eye (OpenGL's stereo).
};

/// What a person did in a window since the last call of input().
struct WindowInput {
  struct Key {
    int code = 0;  ///< GLFW code; letters are upper-case ASCII.
    bool is_down = false;
  };
  cv::Point2f pointer = {-1, -1};         ///< In the window's pixels; negative: outside.
  std::array<bool, 3> buttons = {};       ///< Left, right, middle: held now, or pressed since the last call.
  float wheel = 0;                        ///< Wheel steps upwards.
  std::vector<Key> keys = {};             ///< Presses (also repetitions) and releases, in order.
  std::vector<unsigned> characters = {};  ///< Typed Unicode characters.
};

/// A window on the desktop that shows images, scaled to fit with black bars. Use it only on the main thread.
/// Its own GL context is current only inside its functions; afterwards the former context is current again.
class Window {
 public:
  /// Opens a window with its own Desktop. Error without a display (GLFW needs X or Wayland), and while
  /// another Desktop is open: use the other open() with that one.
  static Result<Window> open(const std::string& title, int width, int height);
  /// Opens one of several windows on a desktop, which can also have monitors.
  static Result<Window> open(const Desktop& desktop, const WindowOptions& options);
  Window(Window&&) noexcept;
  Window& operator=(Window&&) noexcept;
  ~Window();

  /// Shows an 8-bit grey or BGR image from now on and handles pending events.
  void show(const cv::Mat& image);
  /// The same with an image for each eye, in a window with `quad_buffer`.
  void show_eyes(const EyeImages& images);
  /// Handles events and redraws the image; false once the person has closed the window or pressed Escape.
  bool is_open();
  /// The key pressed since the last call (GLFW code; letters are upper-case ASCII), 0 when none.
  int poll_pressed_key();

  /// Calls `paint` with the window's context current and its framebuffer bound, then shows the result. Use it
  /// instead of show().
  void draw(const std::function<void(cv::Size pixels)>& paint);
  /// Calls `work` with the window's context current, for work on GL objects in it.
  void in_context(const std::function<void()>& work);
  /// Handles events and returns what the person did since the last call.
  WindowInput input();
  /// False once the person has closed the window. Draws nothing.
  bool is_wanted() const;
  /// Whether the person has minimised it: nobody can look at it.
  bool is_minimised() const;
  /// The desktop's scale factor for the window: pixels per ordinary pixel, as the person has set it.
  float scale() const;

 private:
  struct Impl;
  explicit Window(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
