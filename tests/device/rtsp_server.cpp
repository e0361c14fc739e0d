#include "tests/device/rtsp_server.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <vector>

namespace limn::test {
namespace {

std::string big_endian(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 0xff);
  return text;
}

std::string sequence_number(const std::string& request) {
  const std::size_t at = request.find("CSeq: ");
  if (at == std::string::npos) return "0";
  return request.substr(at + 6, request.find('\r', at) - at - 6);
}

constexpr const char* k_sdp =
    "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=limn\r\nc=IN IP4 0.0.0.0\r\nt=0 0\r\na=control:*\r\n"
    "m=video 0 RTP/AVP 26\r\na=control:track0\r\n";

struct Jpeg {
  std::string tables;  // quantisation, luminance then chrominance
  std::string scan;
};

// The parts of a baseline JPEG that RFC 2435 sends; its Huffman tables are the standard's.
Jpeg taken_apart(const cv::Mat& image) {
  std::vector<uchar> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 90});
  Jpeg jpeg;
  for (std::size_t at = 2; at + 4 < bytes.size();) {
    const std::size_t size = 256u * bytes[at + 2] + bytes[at + 3];
    const auto from = bytes.begin() + static_cast<long>(at);
    if (bytes[at + 1] == 0xdb)
      for (std::size_t table = 5; table + 64 <= size + 2; table += 65)
        jpeg.tables.append(from + static_cast<long>(table), from + static_cast<long>(table + 64));
    if (bytes[at + 1] == 0xda) {
      jpeg.scan.assign(from + static_cast<long>(2 + size), bytes.end() - 2);
      break;
    }
    at += 2 + size;
  }
  if (jpeg.tables.size() != 128 || jpeg.scan.empty())
    throw std::runtime_error("not the JPEG that was expected");
  return jpeg;
}

}  // namespace

bool RtspClient::begin(LoopbackClient& client) {
  for (;;) {
    const std::string request = client.receive_until("\r\n\r\n");
    if (!request.ends_with("\r\n\r\n")) return false;
    const std::string verb = request.substr(0, request.find(' '));
    std::string answer = fmt::format("RTSP/1.0 200 OK\r\nCSeq: {}\r\n", sequence_number(request));
    if (verb == "OPTIONS") answer += "Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN\r\n\r\n";
    if (verb == "DESCRIBE")
      answer += fmt::format("Content-Type: application/sdp\r\nContent-Length: {}\r\n\r\n{}",
                            std::string_view(k_sdp).size(), k_sdp);
    if (verb == "SETUP") answer += "Session: 7\r\nTransport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n\r\n";
    if (verb == "PLAY") answer += "Session: 7\r\nRTP-Info: url=track0;seq=0;rtptime=0\r\n\r\n";
    if (!client.send(answer)) return false;
    if (verb == "PLAY") return true;
  }
}

bool RtspClient::send(const cv::Mat& image, double seconds) {
  constexpr std::size_t k_packet = 1400;
  const Jpeg jpeg = taken_apart(image);
  const auto ticks = static_cast<std::uint32_t>(90000 * seconds);  // RTP's clock for video
  for (std::size_t at = 0; at < jpeg.scan.size(); at += k_packet) {
    const bool last = at + k_packet >= jpeg.scan.size();
    std::string packet = big_endian(0x80, 1) + big_endian(last ? 0x9a : 0x1a, 1) + big_endian(packets_++, 2) +
                         big_endian(ticks, 4) + big_endian(1, 4);
    // Type 1 is 4:2:0; Q 255 sends its own tables, with the first fragment.
    packet += big_endian(0, 1) + big_endian(at, 3) + big_endian(1, 1) + big_endian(255, 1) +
              big_endian(static_cast<std::uint64_t>(image.cols / 8), 1) +
              big_endian(static_cast<std::uint64_t>(image.rows / 8), 1);
    if (at == 0) packet += big_endian(0, 2) + big_endian(128, 2) + jpeg.tables;
    packet += jpeg.scan.substr(at, k_packet);
    if (!client_.send(big_endian('$', 1) + big_endian(0, 1) + big_endian(packet.size(), 2) + packet))
      return false;
  }
  return true;
}

}  // namespace limn::test
