#pragma once

#include <memory>
#include <vector>

#include "device/camera_source.h"
#include "device/sensor_settings.h"

namespace limn::device {

struct GigeCameraOptions {
  std::string name = "camera0";  ///< what the frames are called
  cv::Size size = {};          ///< a region of this size in the sensor's middle; empty: as the camera stands
  SensorSettings sensor = {};  ///< white_balance_k: no such thing in GigE Vision, it is said so in settings()
  bool grey = false;           ///< brightness alone: Mono8 where the camera has it
  double limit_s = 2;          ///< next() returns by then, with a frame or an error; 1 s later after a search
};

/// An industrial camera (GigE Vision; USB3 Vision goes the same way) through Aravis: Mono8, 8-bit Bayer, RGB8
/// or BGR8. Stamps are the arrival of a frame's first packet as Aravis' own thread saw it, less half the
/// exposure. Of the frames that wait only the newest is decoded. A lost camera is searched for again, after
/// 0.1 s, doubling to 2 s, once Aravis has let go of it. At its end a camera that is gone holds nobody up for
/// more than a second.
class GigeCamera : public CameraSource {
 public:
  /// `id` as Aravis has it (`Vendor-Model-Serial`), or the camera's IP address; empty: the first that
  /// answers. Errors: nobody of that id, another program holds it, no format of ours, no frame in time.
  static Result<GigeCamera> open(const std::string& id, const GigeCameraOptions& options = {});
  GigeCamera(GigeCamera&&) noexcept;
  GigeCamera& operator=(GigeCamera&&) noexcept;
  ~GigeCamera() override;

  const std::string& name() const override;
  cv::Size size() const override;
  Result<Frame> next() override;
  std::string description() const override;
  /// What was asked for: as the camera says after setting.
  std::vector<CameraSetting> settings() const override;

 private:
  struct Impl;
  explicit GigeCamera(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Ids of the cameras that answer on the network (and on USB3), after a search of a second.
std::vector<std::string> gige_cameras();

}  // namespace limn::device
