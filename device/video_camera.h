#pragma once

#include <filesystem>
#include <memory>

#include "device/camera_source.h"

namespace limn::device {

struct VideoCameraOptions {
  std::string name = "camera0";  ///< The camera's name in its frames.
  bool grey = false;             ///< Grey frames only.
  /// For a stream: next() returns within this time, or within twice the time if the stream ends late in it.
  double limit_s = 2;
};

/// A video, read with OpenCV (FFmpeg): a file, or a network camera's RTSP stream over TCP.
///
/// A file's stamps are its own frame times, from the session clock's zero; next() never waits. A stream's
/// stamps are arrival times (see VideoClock). Of several waiting frames only the newest is used, and a lost
/// stream is opened again, first after 0.1 s, then at intervals that double up to 2 s.
class VideoCamera : public CameraSource {
 public:
  /// Errors: no such file, no video in it.
  static Result<VideoCamera> open_file(const std::filesystem::path& path,
                                       const VideoCameraOptions& options = {});
  /// Opens `rtsp://[NAME:PASSWORD@]HOST[:PORT]/PATH`. Errors: another form of address, no answer, no video
  /// within the limit.
  static Result<VideoCamera> open_rtsp(const std::string& url, const VideoCameraOptions& options = {});
  VideoCamera(VideoCamera&&) noexcept;
  VideoCamera& operator=(VideoCamera&&) noexcept;
  ~VideoCamera() override;

  const std::string& name() const override;
  cv::Size size() const override;
  /// Error at the end of a file. For a stream: error when no frame of the first one's size came within the
  /// limit.
  Result<Frame> next() override;
  bool is_finite() const override;
  std::string description() const override;

 private:
  struct Impl;
  explicit VideoCamera(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::device
