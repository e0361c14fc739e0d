#include "core/image_io.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/file.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

enum class Kind { png, jpeg, other };

Kind kind_of(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return Kind::png;
  if (bytes.starts_with("\xff\xd8\xff")) return Kind::jpeg;
  return Kind::other;
}

// Offset after a JPEG's header segments, where the scan starts. Segments are skipped by their length, because
// thumbnails in APP segments contain markers, too.
std::size_t jpeg_scan_start(std::string_view bytes) {
  std::size_t at = 2;
  while (at + 4 <= bytes.size() && bytes[at] == '\xff' && bytes[at + 1] != '\xda') {
    at += 2 + 256u * static_cast<unsigned char>(bytes[at + 2]) + static_cast<unsigned char>(bytes[at + 3]);
  }
  return at;
}

// A PNG ends in its IEND chunk and a JPEG's scan in an end-of-image marker. Without them cv::imdecode returns
// the rows that it got and leaves the rest grey or black.
bool is_complete(std::string_view bytes, Kind kind) {
  if (kind == Kind::png) return bytes.rfind("IEND") != std::string_view::npos;
  if (kind == Kind::jpeg) return bytes.find("\xff\xd9", jpeg_scan_start(bytes)) != std::string_view::npos;
  return true;
}

Result<cv::Mat> read(const fs::path& path, int flags) {
  const auto content = read_file(path);
  if (!content) return content.error();
  const std::string& bytes = *content;
  const Kind kind = kind_of(bytes);
  if (kind == Kind::other) {
    return error("{}: expected a PNG or JPEG image, found {}.", path.string(),
                 bytes.empty() ? std::string("an empty file") : fmt::format("{} other bytes", bytes.size()));
  }
  const Error truncated = error(
      "{}: expected a complete {} image, found a truncated or damaged one ({} bytes). "
      "Copy or capture it again.",
      path.string(), kind == Kind::png ? "PNG" : "JPEG", bytes.size());
  if (!is_complete(bytes, kind)) return truncated;
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
    cv::Mat image = cv::imdecode(encoded, flags | cv::IMREAD_IGNORE_ORIENTATION);
    if (image.empty()) return truncated;
    if (std::max(image.cols, image.rows) > k_max_image_side)
      return error("{}: expected at most {} pixels a side, found {}x{}. Make it smaller.", path.string(),
                   k_max_image_side, image.cols, image.rows);
    return image;
  } catch (const cv::Exception&) {
    return truncated;
  }
}

std::uint32_t crc32(std::string_view bytes) {
  std::uint32_t crc = ~0u;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (0xedb88320u & (0u - (crc & 1)));
  }
  return ~crc;
}

std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xff);
  return bytes;
}

// The pHYs chunk (pixels per metre on both axes), which goes directly after IHDR.
std::string physical_size_chunk(double pixels_per_metre) {
  const std::string density = big_endian(static_cast<std::uint32_t>(std::lround(pixels_per_metre)));
  const std::string body = "pHYs" + density + density + std::string(1, '\1');
  return big_endian(static_cast<std::uint32_t>(body.size() - 4)) + body + big_endian(crc32(body));
}

std::string base64(const std::vector<uchar>& bytes) {
  static constexpr char k_digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
    std::uint32_t group = 0;
    for (std::size_t i = 0; i < 3; ++i) group = group << 8 | (i < count ? bytes[at + i] : 0u);
    for (std::size_t i = 0; i < 4; ++i) text += i <= count ? k_digits[group >> (18 - 6 * i) & 63] : '=';
  }
  return text;
}

constexpr std::size_t k_behind_ihdr = 8 + 25;  // signature, then length + "IHDR" + 13 bytes + CRC

}  // namespace

Result<cv::Mat> read_image(const fs::path& path) { return read(path, cv::IMREAD_ANYCOLOR); }

Result<cv::Mat> read_image_with_alpha(const fs::path& path) {
  cv::Mat image;
  LIMN_TRY(image, read(path, cv::IMREAD_UNCHANGED));
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, 1.0 / 257);
  return image;
}

Result<cv::Mat> read_grey_image(const fs::path& path) { return read(path, cv::IMREAD_GRAYSCALE); }

cv::Mat to_grey(const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, image.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  return grey;
}

Status write_png(const fs::path& path, const cv::Mat& image, const PngOptions& options) {
  LIMN_CHECK(!image.empty());
  std::vector<uchar> encoded;
  // OpenCV's fast setting is the one without a level: with a level, libpng tries all filters instead of one.
  // The fast setting takes half the time; the file is up to a third larger.
  std::vector<int> flags;
  if (options.compression != 1) flags = {cv::IMWRITE_PNG_COMPRESSION, options.compression};
  cv::imencode(".png", image, encoded, flags);
  std::string bytes(encoded.begin(), encoded.end());
  if (options.pixels_per_metre > 0)
    bytes.insert(k_behind_ihdr, physical_size_chunk(options.pixels_per_metre));
  return write_file(path, bytes);
}

std::string data_uri(const cv::Mat& image) {
  std::vector<uchar> encoded;
  cv::imencode(".jpg", image, encoded, {cv::IMWRITE_JPEG_QUALITY, 90});
  return "data:image/jpeg;base64," + base64(encoded);
}

}  // namespace limn
