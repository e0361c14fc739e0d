#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "device/camera_source.h"
#include "device/sensor_settings.h"

namespace limn::device {

/// What a V4l2Camera asks of the kernel. Tests put recorded drivers in its place. Failures set errno.
struct V4l2System {
  std::function<int(const std::string& path)> open;  ///< descriptor, or -1
  std::function<void(int fd)> close;
  std::function<int(int fd, unsigned long request, void* argument)> ioctl;  ///< 0, or -1
  std::function<void*(int fd, std::size_t length, long offset)> map;        ///< nullptr on failure
  std::function<void(void* memory, std::size_t length)> unmap;
  std::function<bool(int fd, double seconds)>
      wait;  ///< until a frame or a fault is there; false: nothing came

  static V4l2System kernel();
};

struct V4l2CameraOptions {
  std::string name = "camera0";  ///< what the frames are called
  cv::Size size = {};            ///< of the frames; empty: as the driver stands
  SensorSettings sensor = {};
  bool grey = false;   ///< brightness alone
  double limit_s = 2;  ///< next() returns by then, with a frame or an error
};

/// A camera of the Linux kernel (USB webcams, capture cards): MJPG, YUYV or GREY, whichever comes first of
/// what it has (GREY first when `grey`). Stamps are the kernel's monotonic ones, moved to the middle of the
/// exposure where that is known; a stamp that is not monotonic, or not of the last second, is replaced by the
/// moment of reading. Of the frames that wait only the newest is decoded. A device that was unplugged or
/// broke is opened again under its path, after 0.1 s, doubling to 2 s.
class V4l2Camera : public CameraSource {
 public:
  /// `path` such as /dev/video0, or /dev/v4l/by-id/… which keeps to one camera. Errors: no such device, no
  /// camera, no format of ours, another format or size than asked for, too few or too small buffers, no frame
  /// in time.
  static Result<V4l2Camera> open(const std::string& path,
                                 const V4l2CameraOptions& options = {},
                                 const V4l2System& system = V4l2System::kernel());
  V4l2Camera(V4l2Camera&&) noexcept;
  V4l2Camera& operator=(V4l2Camera&&) noexcept;
  ~V4l2Camera() override;

  const std::string& name() const override;
  cv::Size size() const override;
  Result<Frame> next() override;
  std::string description() const override;
  /// Exposure, gain and white balance where asked for: what the driver says after setting.
  std::vector<CameraSetting> settings() const override;

 private:
  struct Impl;
  explicit V4l2Camera(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// A capture device of this machine.
struct V4l2Device {
  std::string path;     ///< /dev/video0
  std::string card;     ///< the driver's name for it
  std::string problem;  ///< a sentence when it cannot be opened; else empty
};

/// The cameras at /dev/video0 to /dev/video63; nodes that give no images (metadata) are left out.
std::vector<V4l2Device> v4l2_cameras(const V4l2System& system = V4l2System::kernel());

}  // namespace limn::device
