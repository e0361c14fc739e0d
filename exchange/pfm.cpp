#include "exchange/pfm.h"

#include <bit>
#include <charconv>
#include <cstring>
#include <optional>
#include <string_view>

namespace limn::exchange {
namespace {

static_assert(std::endian::native == std::endian::little);

// Reads the number at the front of `text` and removes it with the one byte of white space that ends it.
template <class Number>
std::optional<Number> taken(std::string_view* text) {
  const std::size_t first = text->find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return std::nullopt;
  Number number{};
  const auto [end, code] = std::from_chars(text->data() + first, text->data() + text->size(), number);
  const auto length = static_cast<std::size_t>(end - text->data());
  if (code != std::errc() || length >= text->size()) return std::nullopt;
  const char behind = (*text)[length];
  if (behind != '\n' && behind != ' ' && behind != '\t' && behind != '\r') return std::nullopt;
  text->remove_prefix(length + 1);
  return number;
}

void swap_bytes(char* data, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i, data += 4) {
    std::swap(data[0], data[3]);
    std::swap(data[1], data[2]);
  }
}

}  // namespace

std::string pfm_bytes(const cv::Mat& image) {
  LIMN_CHECK(image.type() == CV_32FC3);
  std::string bytes = fmt::format("PF\n{} {}\n-1.000000\n", image.cols, image.rows);
  for (int row = image.rows - 1; row >= 0; --row)
    bytes.append(image.ptr<char>(row), static_cast<std::size_t>(image.cols) * image.elemSize());
  return bytes;
}

Result<cv::Mat> read_pfm(const std::string& bytes, const std::string& where, std::int64_t most_pixels) {
  std::string_view text = bytes;
  if (!text.starts_with("PF") || text.size() < 3)
    return error("{}: expected a PFM of three channels (it begins with PF), found {} other bytes.", where,
                 text.size());
  text.remove_prefix(2);
  const auto width = taken<int>(&text), height = taken<int>(&text);
  if (!width || !height || *width < 1 || *height < 1)
    return error("{}: expected a PFM's width and height, both at least 1, found none.", where);
  const std::int64_t pixels = std::int64_t{*width} * *height;
  if (pixels > most_pixels)
    return error("{}: expected at most {} pixels, found {}x{}.", where, most_pixels, *width, *height);
  const auto wanted = static_cast<std::size_t>(pixels) * 3 * sizeof(float);
  std::optional<double> scale = -1;
  if (text.size() != wanted) scale = taken<double>(&text);
  if (!scale || *scale == 0)
    return error("{}: expected a PFM's scale (-1 for little-endian) after its size, found none.", where);
  if (text.size() != wanted) {
    return error("{}: expected {} bytes for {}x{} pixels, found {}. Export it again.", where, wanted, *width,
                 *height, text.size());
  }
  cv::Mat image(*height, *width, CV_32FC3);
  const std::size_t row_bytes = wanted / static_cast<std::size_t>(*height);
  for (int row = *height - 1; row >= 0; --row, text.remove_prefix(row_bytes)) {
    std::memcpy(image.ptr<char>(row), text.data(), row_bytes);
    if (*scale > 0) swap_bytes(image.ptr<char>(row), row_bytes / sizeof(float));
  }
  return image;
}

}  // namespace limn::exchange
