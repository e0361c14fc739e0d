#pragma once

#include <memory>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::device {

/// An output of the desktop as it is fed.
struct Monitor {
  std::string name;  ///< the output's (`HDMI-1`); a second of the same name is `NAME#2`, left before right
  cv::Size size;     ///< of the mode it is in, pixels
  cv::Size largest;  ///< of the modes it has: what it is built for, mostly
  int refresh_hz = 0;
  cv::Point position;  ///< of its top left pixel on the desktop
};

/// The desktop that windows and monitors belong to (X or Wayland, through GLFW). One at a time in a program;
/// copies are the same one, and what was opened on it keeps it alive. Belongs to the main thread.
class Desktop {
 public:
  /// Error without a display, and while one is open: pass that one on.
  static Result<Desktop> open();

  /// What is plugged in now and shows a part of the desktop.
  std::vector<Monitor> monitors() const;
  std::optional<Monitor> find(const std::string& name) const;

 private:
  friend class MonitorDisplay;
  friend class Window;
  struct Impl;
  explicit Desktop(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<Impl> impl_;
};

}  // namespace limn::device
