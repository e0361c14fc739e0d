#pragma once

#include <optional>
#include <string>

#include "core/enum_names.h"

namespace limn::device {

/// What can be locked; the names, with their units, are the keys of a devices file.
enum class SensorSetting { exposure_ms, gain, white_balance_k };
inline constexpr EnumNames<SensorSetting, 3> k_sensor_settings{{"exposure_ms", "gain", "white_balance_k"}};
inline std::string to_text(SensorSetting setting) { return k_sensor_settings.text(setting); }

/// Values that a camera's sensor is locked to; absent ones leave the device's setting unchanged. A lock
/// switches the automatic control off, and the value is read back (CameraSource::settings()).
struct SensorSettings {
  std::optional<double> exposure_ms = {};
  std::optional<double> gain = {};             ///< V4L2: the driver's own unit; GigE: dB.
  std::optional<double> white_balance_k = {};  ///< Colour temperature, kelvin.
};

}  // namespace limn::device
