#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/result.h"
#include "device/camera_source.h"
#include "device/sensor_settings.h"

namespace limn::device {

struct GigeCameraOptions {
  std::string name = "camera0";  ///< The camera's name in its frames.
  cv::Size size = {};  ///< A region of this size in the sensor's middle; empty: the camera's present region.
  SensorSettings sensor = {};  ///< GigE Vision has no white_balance_k; settings() then reports a problem.
  bool grey = false;           ///< Grey frames only, from Mono8 if the camera has it.
  double limit_s = 2;          ///< next() returns within this time; after a search up to 1 s later.
};

/// Opens an industrial camera (GigE Vision, also USB3 Vision) through Aravis, with Mono8, 8-bit Bayer, RGB8
/// or BGR8. `id` is Aravis' name of the camera (`Vendor-Model-Serial`) or its IP address; empty: the first
/// camera that answers. Errors: no such camera, another program uses it, no supported format, no frame in
/// time; the shared library with Aravis (device/gige/) is not there.
///
/// `captured_at` is the arrival of a frame's first packet, as recorded by Aravis' own thread, minus half the
/// exposure. Of several waiting frames only the newest is decoded. After Aravis has released a lost camera,
/// it is searched for again, first after 0.1 s, then at intervals that double up to 2 s. The destructor waits
/// at most one second for a lost camera.
Result<std::unique_ptr<CameraSource>> open_gige_camera(const std::string& id,
                                                       const GigeCameraOptions& options = {});

/// Ids of the cameras that answer on the network (and on USB3), after a search of a second. Error: the shared
/// library with Aravis is not there.
Result<std::vector<std::string>> gige_cameras();

}  // namespace limn::device
