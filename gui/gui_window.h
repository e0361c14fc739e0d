#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/desktop.h"
#include "device/window.h"
#include "gui/gui.h"

namespace limn::apps {

/// A window of the desktop that Dear ImGui draws in. Belongs to the main thread; leaves the GL context that
/// is current alone and never waits for the monitor.
class GuiWindow {
 public:
  /// As large as wanted, and no larger than the largest monitor.
  static Result<GuiWindow> open(const device::Desktop& desktop,
                                const std::string& title,
                                int width,
                                int height);
  GuiWindow(GuiWindow&&) noexcept = default;
  GuiWindow& operator=(GuiWindow&& other) noexcept;
  ~GuiWindow();

  /// Handles events. The keys that were pressed (GLFW's codes) and went into no text field.
  std::vector<int> pressed_keys();
  /// Whether to draw anew: 30 times a second, soon after a person did something, and never so often that
  /// drawing takes more than a quarter of the time. `also_s`: what is done for each image beside it.
  bool is_due(double also_s = 0) const;
  /// Draws; `widgets` as in Gui::frame.
  void draw(const std::function<void(Gui&)>& widgets);
  /// False once the person has closed it.
  bool is_wanted() const { return window_.is_wanted(); }

 private:
  using Clock = std::chrono::steady_clock;
  explicit GuiWindow(device::Window window) : window_(std::move(window)) {}

  device::Window window_;
  std::unique_ptr<Gui> gui_;
  device::WindowInput input_;  // since it was drawn
  bool is_touched_ = false;
  Clock::time_point drawn_at_{};
  double cost_s_ = 0;
};

}  // namespace limn::apps
