#pragma once

#include <memory>

#include "device/desktop.h"
#include "device/display.h"

namespace limn::device {

struct MonitorDisplayOptions {
  std::string name = "projector0";
  std::string monitor;   ///< The monitor's name on the desktop (limn doctor lists the names).
  cv::Size size = {};    ///< The rig's size; another mode is an error. Empty: the monitor's present mode.
  double latency_s = 0;  ///< Measured time from the swap to light.
  bool vsync = true;  ///< Each image waits for the next refresh; enable it on only one of several displays.
  bool quad_buffer = false;  ///< With a framebuffer for each eye (OpenGL's stereo).
};

/// A projector or screen, full screen in its present mode: an image's pixels are the device's pixels. Use it
/// only on the main thread. While the monitor is unplugged or in another mode, show() returns an error and
/// nothing appears elsewhere. It continues when a monitor of that name is back.
class MonitorDisplay : public Display {
 public:
  /// Errors: no such monitor (the message lists the monitors), a mode with another size than the rig's, a
  /// desktop that scales.
  static Result<MonitorDisplay> open(const Desktop& desktop, const MonitorDisplayOptions& options);
  MonitorDisplay(MonitorDisplay&&) noexcept;
  MonitorDisplay& operator=(MonitorDisplay&&) noexcept;
  ~MonitorDisplay() override;

  const std::string& name() const override;
  cv::Size size() const override;
  /// Uploads the image and swaps. The returned moment is the end of the swap plus the latency.
  Result<Stamp> show(const cv::Mat& image) override;
  bool is_stereo() const override;
  Result<Stamp> show_eyes(const EyeImages& images) override;

 private:
  struct Impl;
  explicit MonitorDisplay(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
