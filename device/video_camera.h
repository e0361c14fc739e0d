#pragma once

#include <filesystem>
#include <memory>

#include "device/camera_source.h"

namespace limn::device {

struct VideoCameraOptions {
  std::string name = "camera0";  ///< what the frames are called
  bool grey = false;             ///< brightness alone
  double limit_s = 2;  ///< of a stream: next() returns by then (twice that, when it breaks off late)
};

/// A video, read with OpenCV (FFmpeg): a file, or a network camera's RTSP stream over TCP.
///
/// A file's stamps start at the session clock's zero and are the file's own frame times; nothing is waited
/// for. A stream's are those of arrival (see VideoClock); frames that waited are passed over until the
/// newest, and a lost stream is opened again, after 0.1 s, doubling to 2 s.
class VideoCamera : public CameraSource {
 public:
  /// Errors: no such file, no video in it.
  static Result<VideoCamera> open_file(const std::filesystem::path& path,
                                       const VideoCameraOptions& options = {});
  /// `rtsp://[NAME:PASSWORD@]HOST[:PORT]/PATH`. Errors: another address, nobody there, no video within the
  /// limit.
  static Result<VideoCamera> open_rtsp(const std::string& url, const VideoCameraOptions& options = {});
  VideoCamera(VideoCamera&&) noexcept;
  VideoCamera& operator=(VideoCamera&&) noexcept;
  ~VideoCamera() override;

  const std::string& name() const override;
  cv::Size size() const override;
  /// Error at a file's end; of a stream, when no frame of the first one's size came within the limit.
  Result<Frame> next() override;
  bool is_finite() const override;
  std::string description() const override;

 private:
  struct Impl;
  explicit VideoCamera(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
