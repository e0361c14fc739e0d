#pragma once

#include <optional>

namespace limn::device {

/// Values that a camera's sensor is locked to; absent ones leave the device's setting unchanged. A lock
/// switches the automatic control off, and the value is read back (CameraSource::settings()).
struct SensorSettings {
  std::optional<double> exposure_ms = {};
  std::optional<double> gain = {};             ///< V4L2: the driver's own unit; GigE: dB.
  std::optional<double> white_balance_k = {};  ///< Colour temperature, kelvin.
};

}  // namespace limn::device
