#pragma once

#include <memory>
#include <optional>

#include "device/camera_source.h"

namespace limn::device {

/// A camera as people write it down. What is absent stays as the device has it.
struct CameraWanted {
  std::string name = "camera0";
  std::string source;                          ///< see open_camera()
  std::optional<double> exposure_ms = {};      ///< fixed, automatic exposure off (V4L2, GigE)
  std::optional<double> gain = {};             ///< fixed, in the device's own unit (V4L2), in dB (GigE)
  std::optional<double> white_balance_k = {};  ///< fixed colour temperature (V4L2)
  cv::Size size = {};                          ///< frames of this size (V4L2, GigE); another one is an error
  bool grey = false;                           ///< brightness alone: quicker
  bool repeat = false;                         ///< pictures start again after the last
  double limit_s = 2;                          ///< next() returns by then, with a frame or an error
};

/// Opens a camera from its source's text: `http://…` (MJPEG), `rtsp://…`, a video file, a picture or
/// a folder of pictures. Errors: none of these (lists them), settings that such a source has not, what the
/// source itself says, or another size than wanted.
Result<std::unique_ptr<CameraSource>> open_camera(const CameraWanted& wanted);

}  // namespace limn::device
