#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>

#include "tests/device/loopback_server.h"

namespace limn::test {

/// Speaks RTSP (RFC 2326) to one client up to PLAY and then sends images as RTP (RFC 3550) with JPEG in it
/// (RFC 2435) over the same connection. Images are BGR, sides multiples of 16.
class RtspClient {
 public:
  /// Answers OPTIONS, DESCRIBE, SETUP and PLAY; false when the client goes before.
  static bool begin(LoopbackClient& client);
  explicit RtspClient(LoopbackClient& client) : client_(client) {}
  /// Sends an image taken at `seconds` of the sender's clock; false once the client has gone.
  bool send(const cv::Mat& image, double seconds);

 private:
  LoopbackClient& client_;
  std::uint16_t packets_ = 0;
};

}  // namespace limn::test
