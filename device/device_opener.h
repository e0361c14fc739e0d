#pragma once

#include <memory>

#include "core/result.h"
#include "device/open_camera.h"
#include "device/open_display.h"

namespace limn::device {

/// Opens displays and cameras where they are plugged in: at this machine, or at others of a room (nodes/).
class DeviceOpener {
 public:
  virtual ~DeviceOpener() = default;
  virtual Result<std::unique_ptr<Display>> display(const DisplayConfig& config) = 0;
  virtual Result<std::unique_ptr<CameraSource>> camera(const CameraConfig& config) = 0;
};

/// Those of this machine, as open_display() and open_camera() do it. Error: the device is plugged into
/// another machine.
class LocalOpener final : public DeviceOpener {
 public:
  /// `desktop` may be null.
  explicit LocalOpener(const Desktop* desktop) : desktop_(desktop) {}
  Result<std::unique_ptr<Display>> display(const DisplayConfig& config) override;
  Result<std::unique_ptr<CameraSource>> camera(const CameraConfig& config) override;

 private:
  const Desktop* desktop_;
};

}  // namespace limn::device
