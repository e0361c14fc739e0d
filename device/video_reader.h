#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::device {

/// Decodes a video with OpenCV and FFmpeg. Its implementation is in a shared library of its own
/// (device/video/), because FFmpeg and what it needs would take half of the program's start.
class VideoReader {
 public:
  virtual ~VideoReader() = default;

  /// `limits_ms`: for opening and for reading; empty: none. False: there is no video.
  virtual bool open(const std::string& source, const std::vector<int>& limits_ms) = 0;
  virtual bool is_open() const = 0;
  virtual void close() = 0;
  virtual cv::Size size() const = 0;
  /// Goes to the next frame; false: there is none.
  virtual bool grab() = 0;
  /// The frame's time in the video, in seconds.
  virtual double position_s() const = 0;
  /// Decodes the last grabbed frame; false: it cannot be decoded.
  virtual bool retrieve(cv::Mat* image) = 0;
};

/// Error: the shared library is not there, or a library that it needs is not installed.
Result<std::unique_ptr<VideoReader>> make_video_reader();

}  // namespace limn::device
