#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/desktop.h"
#include "device/gui/gui.h"
#include "device/window.h"

namespace limn::gui {

/// A window of the desktop that Dear ImGui draws in. It must be used by the main thread. It does not change
/// the current GL context and never waits for the monitor.
class GuiWindow {
 public:
  /// Opens a window of this size, but no larger than the largest monitor.
  static Result<GuiWindow> open(const device::Desktop& desktop,
                                const std::string& title,
                                int width,
                                int height);
  GuiWindow(GuiWindow&&) noexcept = default;
  GuiWindow& operator=(GuiWindow&& other) noexcept;
  ~GuiWindow();

  /// Handles events and returns the pressed keys (GLFW's codes) that went into no text field.
  std::vector<int> pressed_keys();
  /// Whether to draw again: 30 times a second, sooner after a person did something, and never so often that
  /// drawing takes more than a quarter of the time. `also_s`: time of other work that is done for each image.
  /// Never while the window is minimised.
  bool is_due(double also_s = 0) const;
  /// Draws the window; `widgets` as in Gui::frame.
  void draw(const std::function<void(Gui&)>& widgets);
  /// False after the person has closed it.
  bool is_wanted() const { return window_.is_wanted(); }

 private:
  using Clock = std::chrono::steady_clock;
  explicit GuiWindow(device::Window window) : window_(std::move(window)) {}

  device::Window window_;
  std::unique_ptr<Gui> gui_;
  device::WindowInput input_;  // since the last drawing
  bool is_touched_ = false;
  Clock::time_point drawn_at_{};
  double cost_s_ = 0;
};

}  // namespace limn::gui
