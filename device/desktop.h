#pragma once

#include <memory>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::device {

/// An output of the desktop, in its present mode.
struct Monitor {
  std::string
      name;       ///< The output's name (`HDMI-1`); a second one of the same name, from the left: `NAME#2`.
  cv::Size size;  ///< Pixels of the present mode.
  cv::Size largest;  ///< Pixels of the largest mode, which is mostly the native one.
  int refresh_hz = 0;
  cv::Point position;  ///< Position of its top left pixel on the desktop.
};

/// The desktop that windows and monitors belong to (X or Wayland, through GLFW). A program has one at a time;
/// copies refer to the same one, and everything opened on it keeps it alive. Use it only on the main thread.
class Desktop {
 public:
  /// Error without a display. Also an error while a desktop is open: use a copy of that one.
  static Result<Desktop> open();

  /// The monitors that are plugged in now and show a part of the desktop.
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
