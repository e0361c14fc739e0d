#pragma once

#include <fmt/format.h>

#include <chrono>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/device/loopback_server.h"

namespace limn::test {

/// How a camera that sends MJPEG begins its answer; parts follow.
inline const std::string k_mjpeg_answer =
    "HTTP/1.0 200 OK\r\nServer: test\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n";

/// One image of that answer.
inline std::string mjpeg_part(const std::string& jpeg) {
  return fmt::format("--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n{}\r\n", jpeg.size(),
                     jpeg);
}

/// An MJPEG camera that sends a grey image every 20 ms, until the client leaves.
inline void stream_grey(LoopbackClient& client) {
  std::vector<uchar> bytes;
  cv::imencode(".jpg", cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(90)), bytes);
  client.receive_until("\r\n\r\n");
  bool is_there = client.send(k_mjpeg_answer);
  while (is_there) {
    is_there = client.send(mjpeg_part({bytes.begin(), bytes.end()}));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace limn::test
