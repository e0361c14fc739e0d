#pragma once

#include <memory>

#include "device/camera_source.h"

namespace limn::device {

struct MjpegCameraOptions {
  std::string name = "camera0";           ///< what the frames are called
  bool grey = false;                      ///< brightness alone: half the decoding
  double limit_s = 2;                     ///< next() returns by then, with a frame or an error
  std::size_t max_part_bytes = 32 << 20;  ///< a larger image is an error, not memory
};

/// A network camera that sends JPEGs over HTTP (multipart/x-mixed-replace): most IP cameras, phones,
/// mjpg-streamer. `captured_at` is the arrival of the image's first byte by the kernel's clock (exposure,
/// compression and network lie before it). What waits in the socket is read at each call, and only the newest
/// whole image is decoded. A lost or broken connection is made again, after 0.1 s, doubling to 2 s.
class MjpegCamera : public CameraSource {
 public:
  /// `http://[NAME:PASSWORD@]HOST[:PORT]/PATH`. Waits for the first image, whose size holds from then on.
  /// Errors: another address, or none of a good image within the limit, and why.
  static Result<MjpegCamera> open(const std::string& url, const MjpegCameraOptions& options = {});
  MjpegCamera(MjpegCamera&&) noexcept;
  MjpegCamera& operator=(MjpegCamera&&) noexcept;
  ~MjpegCamera() override;

  const std::string& name() const override;
  cv::Size size() const override;
  /// Broken images and lost connections are mended inside the limit; an error names the last fault. Looking
  /// up a host's name is the one step that the limit does not bound (the resolver's own limits do).
  Result<Frame> next() override;
  std::string description() const override;

 private:
  struct Impl;
  explicit MjpegCamera(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
