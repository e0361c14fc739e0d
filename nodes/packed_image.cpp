#include "nodes/packed_image.h"

#include <algorithm>
#include <cstring>

namespace limn::nodes {
namespace {

constexpr std::size_t k_least_run = 4;  // bytes; a shorter run takes as much place as its pixels

void append_number(std::size_t number, std::vector<std::uint8_t>* out) {
  for (; number >= 0x80; number >>= 7) out->push_back(static_cast<std::uint8_t>(number | 0x80));
  out->push_back(static_cast<std::uint8_t>(number));
}

// The number at the begin of `bytes`, which is removed from them; 0: there is none.
std::size_t next_number(std::span<const std::uint8_t>* bytes) {
  std::size_t number = 0;
  for (unsigned shift = 0; shift < 35 && !bytes->empty(); shift += 7) {
    const std::uint8_t byte = bytes->front();
    *bytes = bytes->subspan(1);
    number |= static_cast<std::size_t>(byte & 0x7f) << shift;
    if ((byte & 0x80) == 0) return number;
  }
  return 0;
}

// All rows, each but the first as its exclusive or with the row above.
std::vector<std::uint8_t> differences(const cv::Mat& image) {
  const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
  std::vector<std::uint8_t> out(row_bytes * static_cast<std::size_t>(image.rows));
  std::uint8_t* to = out.data();
  for (int row = 0; row < image.rows; ++row, to += row_bytes) {
    const std::uint8_t* from = image.ptr(row);
    if (row == 0) {
      std::copy_n(from, row_bytes, to);
    } else {
      const std::uint8_t* above = image.ptr(row - 1);
      for (std::size_t i = 0; i < row_bytes; ++i) to[i] = static_cast<std::uint8_t>(from[i] ^ above[i]);
    }
  }
  return out;
}

// The number of bytes from `at` that repeat the pixel there.
std::size_t run_length(const std::vector<std::uint8_t>& bytes, std::size_t at, std::size_t pixel) {
  std::size_t end = at + pixel;
  while (end < bytes.size() && bytes[end] == bytes[end - pixel]) ++end;
  return (end - at) / pixel * pixel;
}

void append_pixels(const std::vector<std::uint8_t>& bytes,
                   std::size_t begin,
                   std::size_t end,
                   std::size_t pixel,
                   std::vector<std::uint8_t>* out) {
  if (begin == end) return;
  append_number((end - begin) / pixel * 2, out);
  out->insert(out->end(), bytes.data() + begin, bytes.data() + end);
}

}  // namespace

std::vector<std::uint8_t> packed(const cv::Mat& image) {
  if (image.empty()) return {};
  LIMN_CHECK(image.depth() == CV_8U && image.dims == 2);
  const std::vector<std::uint8_t> bytes = differences(image);
  const std::size_t pixel = image.elemSize();
  std::vector<std::uint8_t> out;
  std::size_t begin = 0;  // where the pixels begin that are in no run
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t run = run_length(bytes, at, pixel);
    if (run < k_least_run || run == pixel) {
      at += run;
      continue;
    }
    append_pixels(bytes, begin, at, pixel, &out);
    append_number(run / pixel * 2 + 1, &out);
    out.insert(out.end(), bytes.data() + at, bytes.data() + at + pixel);
    at += run;
    begin = at;
  }
  append_pixels(bytes, begin, bytes.size(), pixel, &out);
  return out;
}

Result<cv::Mat> unpacked(std::span<const std::uint8_t> bytes, const cv::Size& size, int channels) {
  if (size.width == 0 && size.height == 0 && bytes.empty()) return cv::Mat();
  const bool is_size = size.width > 0 && size.height > 0 &&
                       static_cast<long>(size.width) <= k_most_packed_pixels / size.height;
  if (!is_size || (channels != 1 && channels != 3 && channels != 4))
    return error("expected an image of at most {} pixels and 1, 3 or 4 channels, found {}x{} and {}.",
                 k_most_packed_pixels, size.width, size.height, channels);
  cv::Mat image(size, CV_MAKETYPE(CV_8U, channels));
  const auto pixel = static_cast<std::size_t>(channels);
  std::uint8_t *to = image.data, *const end = image.data + image.total() * pixel;
  while (to < end && !bytes.empty()) {
    const std::size_t number = next_number(&bytes), length = number / 2 * pixel;
    const std::size_t stored = number % 2 == 1 ? pixel : length;
    if (length == 0 || length > static_cast<std::size_t>(end - to) || stored > bytes.size()) break;
    for (std::size_t i = 0; i < length; ++i) to[i] = bytes[number % 2 == 1 ? i % pixel : i];
    bytes = bytes.subspan(stored);
    to += length;
  }
  if (to != end || !bytes.empty())
    return error("expected the pixels of an image of {}x{}, found {} bytes too many and {} pixels too few.",
                 size.width, size.height, bytes.size(), static_cast<std::size_t>(end - to) / pixel);
  const std::size_t row_bytes = image.step[0];
  for (std::uint8_t* at = image.data + row_bytes; at < end; ++at)
    *at = static_cast<std::uint8_t>(*at ^ *(at - row_bytes));
  return image;
}

}  // namespace limn::nodes
