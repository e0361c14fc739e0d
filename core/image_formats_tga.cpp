#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "core/image_formats.h"

// Truevision TGA File Format Specification, version 2.0 (1991).
namespace limn::image_formats {
namespace {

constexpr std::size_t k_header = 18;
constexpr unsigned k_palette = 1, k_colour = 2, k_grey = 3, k_run_length = 8;  // image types

struct Header {
  unsigned id_size = 0, palette_first = 0, palette_count = 0, palette_bits = 0;
  unsigned kind = 0;  // k_palette, k_colour or k_grey
  bool is_run_length = false, is_right_to_left = false, is_bottom_up = false;
  int width = 0, height = 0;
  unsigned bits = 0;

  std::size_t pixel_bytes() const { return (bits + 7) / 8; }
  bool has_alpha() const { return (kind == k_palette ? palette_bits : bits) == 32; }
  std::size_t palette_bytes() const { return palette_count * ((palette_bits + 7) / 8); }
};

bool is_colour_depth(unsigned bits) { return bits == 15 || bits == 16 || bits == 24 || bits == 32; }

// Nullopt if the bytes cannot be a TGA.
std::optional<Header> read_header(std::string_view bytes) {
  if (bytes.size() < k_header) return std::nullopt;
  Header header;
  header.id_size = little_endian(bytes, 0, 1);
  const unsigned has_palette = little_endian(bytes, 1, 1), type = little_endian(bytes, 2, 1);
  header.is_run_length = (type & k_run_length) != 0;
  header.kind = type & ~k_run_length;
  header.palette_first = little_endian(bytes, 3, 2);
  header.palette_count = little_endian(bytes, 5, 2);
  header.palette_bits = little_endian(bytes, 7, 1);
  header.width = static_cast<int>(little_endian(bytes, 12, 2));
  header.height = static_cast<int>(little_endian(bytes, 14, 2));
  header.bits = little_endian(bytes, 16, 1);
  const unsigned descriptor = little_endian(bytes, 17, 1);
  header.is_right_to_left = (descriptor & 0x10) != 0;
  header.is_bottom_up = (descriptor & 0x20) == 0;
  if (has_palette > 1 || header.kind < k_palette || header.kind > k_grey || (descriptor & 0xc0) != 0)
    return std::nullopt;
  if (header.kind == k_palette && (has_palette == 0 || !is_colour_depth(header.palette_bits)))
    return std::nullopt;
  const bool is_sound =
      header.kind == k_colour ? is_colour_depth(header.bits) : header.bits == 8 || header.bits == 16;
  return is_sound ? std::optional(header) : std::nullopt;
}

using Pixel = std::array<uchar, 4>;  // blue, green, red, alpha

Pixel colour_at(std::string_view bytes, std::size_t at, unsigned bits) {
  const auto byte = [&](std::size_t i) { return static_cast<uchar>(bytes[at + i]); };
  if (bits >= 24) return {byte(0), byte(1), byte(2), bits == 32 ? byte(3) : uchar{255}};
  const unsigned packed = little_endian(bytes, at, 2);
  const auto level = [&](unsigned shift) { return static_cast<uchar>((packed >> shift & 31) * 255 / 31); };
  return {level(0), level(5), level(10), 255};
}

// The bytes of all pixels without run lengths. Nullopt: the file ends too early.
std::optional<std::string> unpacked(std::string_view data, const Header& header) {
  const std::size_t pixel = header.pixel_bytes();
  const std::size_t size =
      pixel * static_cast<std::size_t>(header.width) * static_cast<std::size_t>(header.height);
  if (!header.is_run_length)
    return data.size() < size ? std::nullopt : std::optional(std::string(data.substr(0, size)));
  std::string pixels;
  std::size_t at = 0;
  while (pixels.size() < size) {
    if (at >= data.size()) return std::nullopt;
    const unsigned packet = little_endian(data, at++, 1);
    const std::size_t count = (packet & 127) + 1, stored = packet & 128 ? pixel : count * pixel;
    if (stored > data.size() - at) return std::nullopt;
    for (std::size_t i = 0; i < (packet & 128 ? count : 1); ++i) pixels.append(data.substr(at, stored));
    at += stored;
  }
  return pixels;
}

// One table entry for each colour of the palette; none if the pixels are colours. Nullopt: the file ends in
// the palette.
std::optional<std::vector<Pixel>> read_palette(std::string_view data, const Header& header) {
  if (data.size() < header.palette_bytes()) return std::nullopt;
  std::vector<Pixel> palette;
  if (header.kind != k_palette) return palette;
  for (std::size_t i = 0; i < header.palette_count; ++i)
    palette.push_back(colour_at(data, i * ((header.palette_bits + 7) / 8), header.palette_bits));
  return palette;
}

// Nullopt: a pixel names a colour that the palette does not have.
std::optional<cv::Mat> coloured(const std::string& pixels,
                                const Header& header,
                                const std::vector<Pixel>& palette) {
  cv::Mat image(header.height, header.width, CV_8UC4);
  std::size_t at = 0;
  for (int y = 0; y < header.height; ++y)
    for (int x = 0; x < header.width; ++x, at += header.pixel_bytes()) {
      Pixel pixel;
      if (header.kind == k_palette) {
        const std::size_t index = little_endian(pixels, at, header.pixel_bytes()) - header.palette_first;
        if (index >= palette.size()) return std::nullopt;
        pixel = palette[index];
      } else {
        pixel = colour_at(pixels, at, header.bits);
      }
      std::copy(pixel.begin(), pixel.end(), image.ptr<cv::Vec4b>(y)[x].val);
    }
  return image;
}

cv::Mat grey(const std::string& pixels, const Header& header) {
  // The second byte of 16 bits is alpha, which no program that is known writes for grey.
  cv::Mat image(header.height, header.width, CV_8U);
  std::size_t at = 0;
  for (int y = 0; y < header.height; ++y)
    for (int x = 0; x < header.width; ++x, at += header.pixel_bytes())
      image.ptr(y)[x] = static_cast<uchar>(pixels[at]);
  return image;
}

}  // namespace

bool is_tga(std::string_view bytes) { return read_header(bytes).has_value(); }

Result<StoredImage> decode_tga(std::string_view bytes) {
  const auto header = read_header(bytes);
  if (!header) return damaged("TGA", bytes, "its header is none");
  LIMN_TRY_STATUS(check_size(header->width, header->height));
  const Error too_short = damaged("TGA", bytes, "the file ends too early");
  std::string_view data = bytes.substr(std::min(bytes.size(), k_header + header->id_size));
  const auto palette = read_palette(data, *header);
  if (!palette) return too_short;
  data.remove_prefix(header->palette_bytes());
  const auto pixels = unpacked(data, *header);
  if (!pixels) return too_short;
  const auto image =
      header->kind == k_grey ? std::optional(grey(*pixels, *header)) : coloured(*pixels, *header, *palette);
  if (!image) return damaged("TGA", bytes, "a pixel has a colour beyond the palette");
  StoredImage stored{*image};
  if (header->is_bottom_up) cv::flip(stored.samples, stored.samples, 0);
  if (header->is_right_to_left) cv::flip(stored.samples, stored.samples, 1);
  if (!header->has_alpha() && header->kind != k_grey)
    cv::cvtColor(stored.samples, stored.samples, cv::COLOR_BGRA2BGR);
  drop_empty_alpha(&stored.samples);
  return stored;
}

}  // namespace limn::image_formats
