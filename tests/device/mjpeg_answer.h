#pragma once

#include <fmt/format.h>

#include <string>

namespace limn::test {

/// How a camera that sends MJPEG begins its answer; parts follow.
inline const std::string k_mjpeg_answer =
    "HTTP/1.0 200 OK\r\nServer: test\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n";

/// One image of that answer.
inline std::string mjpeg_part(const std::string& jpeg) {
  return fmt::format("--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n{}\r\n", jpeg.size(),
                     jpeg);
}

}  // namespace limn::test
