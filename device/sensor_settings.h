#pragma once

#include <optional>

namespace limn::device {

/// What a camera's sensor is to be locked to; what is absent stays as the device has it. A lock switches the
/// device's own automatism off and is read back (CameraSource::settings()).
struct SensorSettings {
  std::optional<double> exposure_ms = {};
  std::optional<double> gain = {};             ///< V4L2: the driver's own unit; GigE: dB
  std::optional<double> white_balance_k = {};  ///< colour temperature
};

}  // namespace limn::device
