#pragma once

#include <memory>

#include "device/camera_source.h"

namespace limn::device {

struct MjpegCameraOptions {
  std::string name = "camera0";           ///< The camera's name in its frames.
  bool grey = false;                      ///< Grey frames only, which halves the time of decoding.
  double limit_s = 2;                     ///< next() returns within this time, with a frame or an error.
  std::size_t max_part_bytes = 32 << 20;  ///< A larger image is an error, which limits the memory.
};

/// A network camera that sends JPEGs over HTTP (multipart/x-mixed-replace): most IP cameras, phones,
/// mjpg-streamer. `captured_at` is the kernel's arrival time of the image's first byte, which is later than
/// the exposure by the time of compression and network. Each call reads everything that waits in the socket
/// and decodes only the newest complete image. A lost connection is made again, first after 0.1 s, then at
/// intervals that double up to 2 s.
class MjpegCamera : public CameraSource {
 public:
  /// Opens `http://[NAME:PASSWORD@]HOST[:PORT]/PATH` and waits for the first image; later ones must have its
  /// size. Errors: another form of address, or no valid image within the limit, with the reason.
  static Result<MjpegCamera> open(const std::string& url, const MjpegCameraOptions& options = {});
  MjpegCamera(MjpegCamera&&) noexcept;
  MjpegCamera& operator=(MjpegCamera&&) noexcept;
  ~MjpegCamera() override;

  const std::string& name() const override;
  cv::Size size() const override;
  /// After damaged images and lost connections it tries again within the limit; an error names the last
  /// fault. The limit does not include the look-up of the host's name, which has the resolver's own limits.
  Result<Frame> next() override;
  std::string description() const override;

 private:
  struct Impl;
  explicit MjpegCamera(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
