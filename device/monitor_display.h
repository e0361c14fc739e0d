#pragma once

#include <memory>

#include "device/desktop.h"
#include "device/display.h"

namespace limn::device {

struct MonitorDisplayOptions {
  std::string name = "projector0";
  std::string monitor;   ///< its name on the desktop (limn doctor lists them)
  cv::Size size = {};    ///< the rig's; a monitor in another mode is refused. Empty: as the monitor stands
  double latency_s = 0;  ///< measured, from the swap to light
  bool vsync = true;     ///< for the next refresh at each image; of several, let one wait
};

/// A projector or screen, full screen in the mode it is in: an image's pixel is the device's. Belongs to the
/// main thread. While the monitor is unplugged, or in another mode, nothing of it shows elsewhere and show()
/// says so; it goes on when the monitor of that name is back.
class MonitorDisplay : public Display {
 public:
  /// Errors: no such monitor (lists those there are), another mode than the rig's size (both sizes), a
  /// desktop that scales.
  static Result<MonitorDisplay> open(const Desktop& desktop, const MonitorDisplayOptions& options);
  MonitorDisplay(MonitorDisplay&&) noexcept;
  MonitorDisplay& operator=(MonitorDisplay&&) noexcept;
  ~MonitorDisplay() override;

  const std::string& name() const override;
  cv::Size size() const override;
  /// Uploads and swaps; the moment is when the driver had swapped, plus the latency.
  Result<Stamp> show(const cv::Mat& image) override;

 private:
  struct Impl;
  explicit MonitorDisplay(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
