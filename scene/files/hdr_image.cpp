#include "scene/files/hdr_image.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/file.h"
#include "scene/files/exr_image.h"

namespace limn::scene {
namespace {

constexpr std::string_view k_exr_magic = "\x76\x2f\x31\x01";

// The file's bytes, one line or one byte at a time.
class Bytes {
 public:
  explicit Bytes(std::string_view all) : left_(all) {}
  std::string_view line() {
    const std::size_t end = std::min(left_.find('\n'), left_.size());
    const std::string_view line = left_.substr(0, end);
    left_.remove_prefix(std::min(end + 1, left_.size()));
    return line;
  }
  bool is_at_end() const { return left_.empty(); }
  std::size_t left() const { return left_.size(); }
  /// 0 beyond the end.
  std::uint8_t next() {
    if (left_.empty()) {
      has_ended_ = true;
      return 0;
    }
    const auto byte = static_cast<std::uint8_t>(left_.front());
    left_.remove_prefix(1);
    return byte;
  }
  std::uint8_t peek(std::size_t i) const {
    return i < left_.size() ? static_cast<std::uint8_t>(left_[i]) : 0;
  }
  /// Whether next() was called at the end.
  bool has_ended() const { return has_ended_; }

 private:
  std::string_view left_;
  bool has_ended_ = false;
};

using Rgbe = std::array<std::uint8_t, 4>;

// A row whose channels are packed one after another. False: a run is longer than the row.
bool read_packed_row(Bytes* bytes, std::vector<Rgbe>* row) {
  for (int i = 0; i < 4; ++i) bytes->next();
  for (std::size_t channel = 0; channel < 4; ++channel)
    for (std::size_t at = 0; at < row->size() && !bytes->has_ended();) {
      const std::uint8_t code = bytes->next();
      const bool is_run = code > 128;
      const std::size_t count = is_run ? code - 128U : code;
      if (count == 0 || count > row->size() - at) return false;
      const std::uint8_t value = is_run ? bytes->next() : std::uint8_t{0};
      for (std::size_t i = 0; i < count; ++i) (*row)[at++][channel] = is_run ? value : bytes->next();
    }
  return true;
}

// A row of whole pixels, in which (1, 1, 1, n) repeats the pixel before. False: a run is longer than the row.
bool read_plain_row(Bytes* bytes, std::vector<Rgbe>* row) {
  unsigned shift = 0;
  for (std::size_t at = 0; at < row->size() && !bytes->has_ended();) {
    Rgbe pixel;
    for (std::uint8_t& byte : pixel) byte = bytes->next();
    if (pixel[0] != 1 || pixel[1] != 1 || pixel[2] != 1) {
      (*row)[at++] = pixel;
      shift = 0;
      continue;
    }
    const std::size_t count = shift < 24 ? std::size_t{pixel[3]} << shift : row->size() + 1;
    if (at == 0 || count > row->size() - at) return false;
    std::fill_n(row->begin() + static_cast<std::ptrdiff_t>(at), count, (*row)[at - 1]);
    at += count;
    shift += 8;
  }
  return true;
}

// "-Y HEIGHT +X WIDTH", the usual order of rows and columns.
std::optional<cv::Size> size_of(std::string_view line) {
  const auto number = [&](std::string_view before) -> int {
    if (!line.starts_with(before)) return 0;
    line.remove_prefix(before.size());
    int value = 0;
    const auto [end, failed] = std::from_chars(line.data(), line.data() + line.size(), value);
    if (failed != std::errc()) return 0;
    line.remove_prefix(static_cast<std::size_t>(end - line.data()));
    return value;
  };
  const int height = number("-Y "), width = number(" +X ");
  return width > 0 && height > 0 ? std::optional(cv::Size(width, height)) : std::nullopt;
}

Result<cv::Mat> decode_radiance(std::string_view all, const std::string& name) {
  Bytes bytes(all);
  double exposure = 1;
  for (std::string_view line = bytes.line(); !line.empty(); line = bytes.line()) {
    if (bytes.is_at_end()) return error("{}: expected a Radiance image, found only its first lines.", name);
    if (line.starts_with("FORMAT=") && line != "FORMAT=32-bit_rle_rgbe")
      return error("{}: expected FORMAT=32-bit_rle_rgbe, found {}.", name, line.substr(0, 60));
    if (line.starts_with("EXPOSURE=")) exposure *= std::strtod(std::string(line.substr(9)).c_str(), nullptr);
  }
  if (!(exposure > 0 && std::isfinite(exposure)))
    return error("{}: expected an EXPOSURE over 0, found {}.", name, exposure);
  const std::string_view resolution = bytes.line();
  const auto size = size_of(resolution);
  if (!size)
    return error("{}: expected \"-Y HEIGHT +X WIDTH\", found \"{}\".", name, resolution.substr(0, 60));
  LIMN_TRY_STATUS(check_hdr_size(name, size->width, size->height));
  // A packed row needs at least two bytes for each 127 pixels of a channel, a plain one 4.
  if (bytes.left() < static_cast<std::size_t>(size->height) * 4)
    return error("{}: expected {} rows of pixels, found the end of the file.", name, size->height);
  cv::Mat image(*size, CV_32FC3);
  std::vector<Rgbe> row(static_cast<std::size_t>(size->width));
  for (int y = 0; y < size->height; ++y) {
    const bool is_packed = bytes.peek(0) == 2 && bytes.peek(1) == 2 && bytes.peek(2) < 128 &&
                           bytes.peek(2) * 256 + bytes.peek(3) == size->width;
    const bool is_good = is_packed ? read_packed_row(&bytes, &row) : read_plain_row(&bytes, &row);
    if (!is_good || bytes.has_ended())
      return error("{}: expected {} rows of pixels, found {} and {}. Is the file complete?", name,
                   size->height, y, bytes.has_ended() ? "the end of the file" : "a damaged row");
    for (int x = 0; x < size->width; ++x) {
      const Rgbe& pixel = row[static_cast<std::size_t>(x)];
      const double scale = pixel[3] == 0 ? 0 : std::ldexp(1 / exposure, pixel[3] - 136);
      for (int c = 0; c < 3; ++c)
        image.at<cv::Vec3f>(y, x)[c] = static_cast<float>(
            std::min<double>(k_most_hdr_light, pixel[static_cast<std::size_t>(2 - c)] * scale));
    }
  }
  return image;
}

}  // namespace

Result<cv::Mat> decode_hdr_image(std::string_view bytes, const std::string& name) {
  const bool is_exr = bytes.starts_with(k_exr_magic);
  if (!is_exr && !bytes.starts_with("#?"))
    return error(
        "{}: expected an image of linear light, Radiance (.hdr) or OpenEXR (.exr), found another format.",
        name);
  LIMN_TRY(cv::Mat image, is_exr ? decode_exr(bytes, name) : decode_radiance(bytes, name));
  for (int y = 0; y < image.rows; ++y)
    for (float* value = image.ptr<float>(y); value < image.ptr<float>(y) + 3L * image.cols; ++value) {
      if (std::isnan(*value)) return error("{}: expected numbers, found none in row {}.", name, y);
      *value = std::clamp(*value, 0.0F, k_most_hdr_light);
    }
  return image;
}

Result<cv::Mat> read_hdr_image(const std::filesystem::path& path) {
  LIMN_TRY(const std::string bytes, read_file(path));
  return decode_hdr_image(bytes, path.string());
}

}  // namespace limn::scene
