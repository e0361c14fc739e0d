#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/image_formats.h"

namespace limn::image_formats {
namespace {

bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Reads the numbers of a header or of the forms P1 to P3, between blanks and comments (# to the line's end).
class Numbers {
 public:
  explicit Numbers(std::string_view bytes) : bytes_(bytes) {}

  // Nullopt: no number here, or one above 2^24. `digits` is the most digits that a number has.
  std::optional<int> next(int digits = 9) {
    skip_blanks();
    int value = 0, count = 0;
    for (; count < digits && at_ < bytes_.size() && is_digit(bytes_[at_]); ++count, ++at_)
      if ((value = 10 * value + bytes_[at_] - '0') > 1 << 24) return std::nullopt;
    if (count == 0) return std::nullopt;
    return value;
  }
  std::size_t at() const { return at_; }

 private:
  void skip_blanks() {
    while (at_ < bytes_.size() && (is_blank(bytes_[at_]) || bytes_[at_] == '#')) {
      if (bytes_[at_] == '#') at_ = std::min(bytes_.find_first_of("\r\n", at_), bytes_.size());
      if (at_ < bytes_.size()) ++at_;
    }
  }
  std::string_view bytes_;
  std::size_t at_ = 2;  // behind the signature
};

struct Header {
  bool is_text = false, is_bitmap = false;
  int channels = 1, width = 0, height = 0, white = 1;
};

// Whether the samples are all there. They are in the order red, green, blue.
bool read_text(Numbers numbers, const Header& header, cv::Mat* samples) {
  for (int y = 0; y < header.height; ++y)
    for (int k = 0; k < header.width * header.channels; ++k) {
      const auto value = numbers.next(header.is_bitmap ? 1 : 9);
      if (!value) return false;
      const int level = header.is_bitmap ? 1 - std::min(*value, 1) : *value;
      samples->ptr<std::uint16_t>(y)[k] = static_cast<std::uint16_t>(std::min(level, header.white));
    }
  return true;
}

bool read_binary(std::string_view data, const Header& header, cv::Mat* samples) {
  const auto count = static_cast<std::size_t>(header.width) * static_cast<std::size_t>(header.channels);
  const std::size_t sample_bytes = header.white > 255 ? 2 : 1;
  const std::size_t row_bytes = header.is_bitmap ? (count + 7) / 8 : count * sample_bytes;
  if (data.size() / row_bytes < static_cast<std::size_t>(header.height)) return false;
  for (int y = 0; y < header.height; ++y) {
    const auto* row =
        reinterpret_cast<const unsigned char*>(data.data()) + static_cast<std::size_t>(y) * row_bytes;
    auto* out = samples->ptr<std::uint16_t>(y);
    for (std::size_t k = 0; k < count; ++k) {
      const int level = header.is_bitmap    ? 1 - (row[k / 8] >> (7 - k % 8) & 1)
                        : sample_bytes == 1 ? row[k]
                                            : 256 * row[2 * k] + row[2 * k + 1];
      out[k] = static_cast<std::uint16_t>(std::min(level, header.white));
    }
  }
  return true;
}

std::optional<Header> read_header(char kind, Numbers* numbers) {
  Header header;
  header.is_text = kind <= '3';
  header.is_bitmap = kind == '1' || kind == '4';
  header.channels = kind == '3' || kind == '6' ? 3 : 1;
  const auto width = numbers->next(), height = numbers->next();
  const auto white = header.is_bitmap ? std::optional(1) : numbers->next();
  if (!width || !height || !white || *white < 1 || *white > 65535) return std::nullopt;
  header.width = *width;
  header.height = *height;
  header.white = *white;
  return header;
}

}  // namespace

Result<StoredImage> decode_pnm(std::string_view bytes) {
  Numbers numbers(bytes);
  const auto header = read_header(bytes[1], &numbers);
  if (!header) return damaged("PNM", bytes, "width, height and maximum are no numbers");
  LIMN_TRY_STATUS(check_size(header->width, header->height));
  cv::Mat samples(header->height, header->width, CV_16UC(header->channels));
  const std::string_view data = bytes.substr(std::min(numbers.at() + 1, bytes.size()));
  const bool is_whole =
      header->is_text ? read_text(numbers, *header, &samples) : read_binary(data, *header, &samples);
  if (!is_whole) return damaged("PNM", bytes, "the file ends too early");
  if (header->white <= 255) samples.convertTo(samples, CV_8U);
  if (header->channels == 3) cv::cvtColor(samples, samples, cv::COLOR_RGB2BGR);
  // 65535 is also the maximum that programs write without knowing how many bits the camera has.
  return StoredImage{samples, header->white, header->white < 65535};
}

}  // namespace limn::image_formats
