#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>

#include "tests/device/loopback_server.h"

namespace limn::test {

/// Serves one client by RTSP (RFC 2326) up to PLAY and then sends images as JPEG (RFC 2435) in RTP (RFC 3550)
/// over the same connection. Images are BGR; their sides must be multiples of 16.
class RtspClient {
 public:
  /// Answers OPTIONS, DESCRIBE, SETUP and PLAY; false when the client closes the connection before that.
  static bool begin(LoopbackClient& client);
  explicit RtspClient(LoopbackClient& client) : client_(client) {}
  /// Sends an image taken at `seconds` of the sender's clock; false once the client has closed the
  /// connection.
  bool send(const cv::Mat& image, double seconds);

 private:
  LoopbackClient& client_;
  std::uint16_t packets_ = 0;
};

}  // namespace limn::test
