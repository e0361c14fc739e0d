#pragma once

#include <memory>

#include "device/camera_source.h"
#include "device/sensor_settings.h"

namespace limn::device {

/// A camera as people write it down. What is absent stays as the device has it.
struct CameraConfig {
  std::string name = "camera0";
  std::string source;          ///< see open_camera()
  SensorSettings sensor = {};  ///< exposure, gain, white balance (V4L2, GigE)
  cv::Size size = {};          ///< frames of this size (V4L2, GigE); another one is an error
  bool grey = false;           ///< brightness alone: quicker
  bool repeat = false;         ///< images start again after the last
  double limit_s = 2;          ///< next() returns by then, with a frame or an error
};

/// Opens a camera from its source's text: `http://…` (MJPEG), `rtsp://…`, `v4l2:/dev/video0`, `gige:ID`, a
/// video file, an image or a folder of images. Errors: none of these (lists them), settings that such a
/// source has not, what the source itself says, or another size than wanted.
Result<std::unique_ptr<CameraSource>> open_camera(const CameraConfig& config);

}  // namespace limn::device
