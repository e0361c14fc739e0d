#pragma once

#include <chrono>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>

namespace limn {

/// A moment on the session's monotonic clock. The variable's name says which moment (`captured_at`).
using Stamp = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

/// The current moment.
inline Stamp now() { return std::chrono::time_point_cast<Stamp::duration>(Stamp::clock::now()); }
/// Seconds from `from` to `to`.
inline double seconds_between(Stamp from, Stamp to) {
  return std::chrono::duration<double>(to - from).count();
}
/// Seconds on the clock of the stamp, as recordings and telemetry store them.
inline double seconds_of(Stamp at) { return seconds_between(Stamp{}, at); }
/// `at` moved by a number of seconds.
inline Stamp shifted(Stamp at, double seconds) {
  return at + std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(seconds));
}

/// One image of one camera: 8-bit, one channel (grey) or three (BGR, sRGB).
struct Frame {
  std::string camera;
  cv::Mat image;
  Stamp captured_at;
  /// The image's luma channel, if the camera's data contain it separately (JPEG); else empty.
  cv::Mat grey = {};
  /// The JPEG that `image` and `grey` were decoded from; null if the camera sent no JPEG.
  std::shared_ptr<const std::string> jpeg = {};
};

}  // namespace limn
