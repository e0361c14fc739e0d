#pragma once

#include <memory>

#include "core/imager.h"
#include "device/camera_source.h"
#include "device/sensor_settings.h"

namespace limn::device {

/// The configuration of a camera. Absent values leave the device's settings unchanged.
struct CameraConfig {
  std::string name = "camera0";
  std::string host = {};       ///< The machine of the room that it is plugged into; empty: this one.
  std::string source = {};     ///< See open_camera().
  SensorSettings sensor = {};  ///< Exposure, gain, white balance (V4L2, GigE only).
  cv::Size size = {};          ///< Size of the frames (V4L2 and GigE set it); another size is an error.
  bool grey = false;           ///< Grey frames only, which is faster.
  bool repeat = false;         ///< Whether stored images start again after the last one.
  Spectrum sees = Spectrum::visible;
  double limit_s = 2;  ///< next() returns within this time, with a frame or an error.
};

/// Opens a camera from its source's text: `http://…` (MJPEG), `rtsp://…`, `v4l2:/dev/video0`, `gige:ID`, a
/// video file, an image or a folder of images. Errors: none of these (the message lists them), settings that
/// such a source does not have, errors of the source itself, or another size than configured.
Result<std::unique_ptr<CameraSource>> open_camera(const CameraConfig& config);

}  // namespace limn::device
