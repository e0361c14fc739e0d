#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "device/camera_source.h"
#include "device/sensor_settings.h"

namespace limn::device {

/// The name of a pixel format of the kernel, such as MJPG; other characters than letters and signs become
/// "?".
std::string fourcc(std::uint32_t format);

/// The kernel functions that V4l2Camera uses. Tests replace them by simulated drivers. Failures set errno.
struct V4l2System {
  std::function<int(const std::string& path)> open;  ///< Returns a descriptor or -1.
  std::function<void(int fd)> close;
  std::function<int(int fd, unsigned long request, void* argument)> ioctl;  ///< Returns 0 or -1.
  std::function<void*(int fd, std::size_t length, long offset)> map;        ///< Returns nullptr on failure.
  std::function<void(void* memory, std::size_t length)> unmap;
  std::function<bool(int fd, double seconds)> wait;  ///< Waits for a frame or a fault; false: neither came.

  static V4l2System kernel();
};

struct V4l2CameraOptions {
  std::string name = "camera0";  ///< The camera's name in its frames.
  cv::Size size = {};            ///< Size of the frames; empty: the driver's present size.
  SensorSettings sensor = {};
  bool grey = false;   ///< Grey frames only.
  double limit_s = 2;  ///< next() returns within this time, with a frame or an error.
};

/// A camera of the Linux kernel (USB webcams, capture cards) with the first of the formats MJPG, YUYV and
/// GREY that it has (GREY first when `grey`). Stamps are the kernel's monotonic times, moved to the middle of
/// the exposure if that is known. A stamp that is not monotonic or not of the last second is replaced by the
/// time of reading. Of several waiting frames only the newest is decoded. After an unplugged cable or a fault
/// the same path is opened again, first after 0.1 s, then at intervals that double up to 2 s.
class V4l2Camera : public CameraSource {
 public:
  /// `path` is such as /dev/video0, or /dev/v4l/by-id/…, which always means the same camera. Errors: no such
  /// device, not a camera, no supported format, another format or size than requested, too few or too small
  /// buffers, no frame in time.
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
  /// The requested exposure, gain and white balance with the values that the driver then reports.
  std::vector<CameraSetting> settings() const override;

 private:
  struct Impl;
  explicit V4l2Camera(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// A capture device of this machine.
struct V4l2Device {
  std::string path;     ///< /dev/video0
  std::string card;     ///< The driver's name for the device.
  std::string problem;  ///< A sentence when it cannot be opened; else empty.
};

/// The cameras at /dev/video0 to /dev/video63. Devices that give no images (metadata) are left out.
std::vector<V4l2Device> v4l2_cameras(const V4l2System& system = V4l2System::kernel());

}  // namespace limn::device
