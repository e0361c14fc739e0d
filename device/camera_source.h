#pragma once

#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/result.h"
#include "device/sensor_settings.h"

namespace limn::device {

/// A setting that was requested from a camera, and the result.
struct CameraSetting {
  SensorSetting name = SensorSetting::exposure_ms;
  double asked = 0;
  std::optional<double> found;  ///< The value that the device then reports; nullopt: it cannot be read.
  std::string problem;          ///< A sentence when the device did not accept the value; else empty.
};

/// Where frames come from: a real camera, a folder of images, the virtual rig.
class CameraSource {
 public:
  virtual ~CameraSource() = default;

  /// The camera's name in its frames (`camera0`).
  virtual const std::string& name() const = 0;
  /// Width and height of every frame.
  virtual cv::Size size() const = 0;
  /// Waits for the next frame. `captured_at` is the middle of its exposure as far as the source knows it.
  /// An error ends the stream of a finite source (is_finite()). Any other source waits for a limited time,
  /// then says why no frame came, and tries again at the next call.
  virtual Result<Frame> next() = 0;

  /// Whether the source has an end, as stored images and video files have.
  virtual bool is_finite() const { return false; }
  /// A line for people: how the camera is read and how many frames were lost so far.
  virtual std::string description() const { return {}; }
  /// The requested settings and what the camera reports.
  virtual std::vector<CameraSetting> settings() const { return {}; }
};

}  // namespace limn::device
