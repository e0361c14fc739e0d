#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <vector>

#include "core/image_formats.h"

// Microsoft, "Bitmap Storage": BITMAPCOREHEADER, BITMAPINFOHEADER, BITMAPV4HEADER and BITMAPV5HEADER.
namespace limn::image_formats {
namespace {

constexpr std::size_t k_file_header = 14, k_core_header = 12, k_info_header = 40;
enum Compression : unsigned { none = 0, run_length_8 = 1, run_length_4 = 2, fields = 3, alpha_fields = 6 };

using Pixel = cv::Vec4b;  // blue, green, red, alpha

struct Header {
  std::size_t size = 0, pixels_at = 0;
  long width = 0, height = 0;
  bool is_top_down = false;
  unsigned bits = 0, compression = none, colours = 0;
  std::array<unsigned, 4> masks{};  // blue, green, red, alpha of 16 and 32 bits

  bool is_run_length() const { return compression == run_length_8 || compression == run_length_4; }
  std::size_t palette_entry() const { return size == k_core_header ? 3 : 4; }
  std::size_t palette_size() const { return colours > 0 ? std::min(colours, 256u) : std::size_t{1} << bits; }
  std::size_t row_bytes() const { return (static_cast<std::size_t>(width) * bits + 31) / 32 * 4; }
  // Headers of newer versions hold the masks; behind older ones they follow.
  std::size_t masks_end() const {
    const std::size_t masks = compression == fields ? 12 : compression == alpha_fields ? 16 : 0;
    return k_file_header + (masks > 0 ? std::max(size, k_info_header + masks) : size);
  }
};

// The first version, OS/2's, has sizes of 16 bits. A negative height means rows from the top.
void read_core_header(std::string_view bytes, Header* header) {
  header->width = little_endian(bytes, 18, 2);
  header->height = little_endian(bytes, 20, 2);
  header->bits = little_endian(bytes, 24, 2);
}

void read_info_header(std::string_view bytes, Header* header) {
  const auto height = static_cast<std::int32_t>(little_endian(bytes, 22, 4));
  header->width = static_cast<std::int32_t>(little_endian(bytes, 18, 4));
  header->height = std::labs(height);
  header->is_top_down = height < 0;
  header->bits = little_endian(bytes, 28, 2);
  header->compression = little_endian(bytes, 30, 4);
  header->colours = little_endian(bytes, 46, 4);
}

// Bits of the colours in a pixel of 16 or 32 bits, from the header or by default.
void read_masks(std::string_view bytes, Header* header) {
  if (header->compression != fields && header->compression != alpha_fields) {
    header->masks = header->bits == 16 ? std::array{0x1fu, 0x3e0u, 0x7c00u, 0u}
                                       : std::array{0xffu, 0xff00u, 0xff0000u, 0u};
    return;
  }
  constexpr std::size_t k_masks = k_file_header + k_info_header;
  for (std::size_t k = 0; k < 3; ++k) header->masks[k] = little_endian(bytes, k_masks + 4 * (2 - k), 4);
  if (header->masks_end() >= k_masks + 16) header->masks[3] = little_endian(bytes, k_masks + 12, 4);
}

Result<Header> read_header(std::string_view bytes) {
  const Error cut = damaged("BMP", bytes, "the file ends in its header");
  if (bytes.size() < k_file_header + k_core_header) return cut;
  Header header;
  header.size = little_endian(bytes, k_file_header, 4);
  header.pixels_at = little_endian(bytes, 10, 4);
  if (header.size != k_core_header && (header.size < k_info_header || header.size > 1024))
    return damaged("BMP", bytes, "its header has an unknown size");
  if (bytes.size() < k_file_header + header.size) return cut;
  if (header.size == k_core_header)
    read_core_header(bytes, &header);
  else
    read_info_header(bytes, &header);
  if (bytes.size() < header.masks_end()) return cut;
  read_masks(bytes, &header);
  // Some programs do not count the palette.
  if (header.bits <= 8 && header.pixels_at == header.masks_end())
    header.pixels_at += header.palette_size() * header.palette_entry();
  return header;
}

Status check(const Header& header) {
  LIMN_TRY_STATUS(check_size(header.width, header.height));
  const unsigned bits = header.bits;
  const bool is_sound =
      header.compression == none
          ? bits == 1 || bits == 2 || bits == 4 || bits == 8 || bits == 16 || bits == 24 || bits == 32
      : header.compression == run_length_8                                 ? bits == 8
      : header.compression == run_length_4                                 ? bits == 4
      : header.compression == fields || header.compression == alpha_fields ? bits == 16 || bits == 32
                                                                           : false;
  if (is_sound) return {};
  return error(
      "expected a BMP of 1 to 32 bits a pixel, plain or with run lengths, found {} bits and compression "
      "{}. Save it as PNG.",
      bits, header.compression);
}

// 256 colours; black where the file has fewer.
std::vector<Pixel> read_palette(std::string_view bytes, const Header& header) {
  std::vector<Pixel> palette(256, Pixel(0, 0, 0, 255));
  const std::size_t entry = header.palette_entry(), start = header.masks_end();
  const std::size_t end = std::min(header.pixels_at, bytes.size());
  for (std::size_t i = 0; i < header.palette_size() && start + (i + 1) * entry <= end; ++i)
    for (int k = 0; k < 3; ++k)
      palette[i][k] = static_cast<uchar>(bytes[start + i * entry + static_cast<std::size_t>(k)]);
  return palette;
}

// The bits of a mask as a level of 0 to 255.
uchar level_of(unsigned pixel, unsigned mask) {
  if (mask == 0) return 255;
  const std::uint64_t most = mask >> std::countr_zero(mask), value = (pixel & mask) >> std::countr_zero(mask);
  return static_cast<uchar>((value * 255 + most / 2) / most);
}

cv::Mat read_plain(std::string_view pixels, const Header& header, const std::vector<Pixel>& palette) {
  cv::Mat image(static_cast<int>(header.height), static_cast<int>(header.width), CV_8UC4);
  for (int y = 0; y < image.rows; ++y) {
    const std::string_view row = pixels.substr(static_cast<std::size_t>(y) * header.row_bytes());
    auto* out = image.ptr<Pixel>(y);
    for (std::size_t x = 0; x < static_cast<std::size_t>(image.cols); ++x) {
      const std::size_t bit = x * header.bits;
      if (header.bits <= 8) {
        const unsigned shift = 8 - header.bits - static_cast<unsigned>(bit % 8);
        out[x] = palette[little_endian(row, bit / 8, 1) >> shift & ((1u << header.bits) - 1)];
        continue;
      }
      const unsigned pixel = little_endian(row, bit / 8, header.bits / 8);
      for (int k = 0; k < 4; ++k) out[x][k] = level_of(pixel, header.masks[static_cast<std::size_t>(k)]);
    }
  }
  return image;
}

// Decodes run lengths. Pixels that are jumped over have the palette's first colour.
class RunLengths {
 public:
  RunLengths(std::string_view data, const Header& header, const std::vector<Pixel>& palette)
      : data_(data),
        bits_(header.bits),
        palette_(palette),
        image_(static_cast<int>(header.height),
               static_cast<int>(header.width),
               CV_8UC4,
               cv::Scalar(palette[0])) {}

  // Empty: the data end too early.
  cv::Mat read() {
    while (at_ + 2 <= data_.size()) {
      const unsigned count = byte(), value = byte();
      if (count > 0) {
        for (unsigned i = 0; i < count; ++i) put(bits_ == 8 ? value : i % 2 == 0 ? value >> 4 : value & 15);
      } else if (value == 0) {
        x_ = 0;
        ++y_;
      } else if (value == 1) {
        return image_;
      } else if (value == 2) {
        if (at_ + 2 > data_.size()) return {};
        x_ += static_cast<int>(byte());
        y_ += static_cast<int>(byte());
      } else if (!put_plain(value)) {
        return {};
      }
    }
    // Some programs leave out the end mark.
    return y_ >= image_.rows || (y_ == image_.rows - 1 && x_ >= image_.cols) ? image_ : cv::Mat();
  }

 private:
  unsigned byte() { return static_cast<unsigned char>(data_[at_++]); }
  void put(unsigned index) {
    if (x_ < image_.cols && y_ < image_.rows) image_.ptr<Pixel>(y_)[x_] = palette_[index];
    ++x_;
  }
  // `count` pixels one by one, filled up to an even number of bytes.
  bool put_plain(unsigned count) {
    const std::size_t bytes = (count * bits_ + 15) / 16 * 2;
    if (at_ + bytes > data_.size()) return false;
    for (unsigned i = 0; i < count; ++i) {
      const unsigned value = little_endian(data_, at_ + i * bits_ / 8, 1);
      put(bits_ == 8 ? value : i % 2 == 0 ? value >> 4 : value & 15);
    }
    at_ += bytes;
    return true;
  }

  std::string_view data_;
  std::size_t at_ = 0;
  unsigned bits_;
  const std::vector<Pixel>& palette_;
  cv::Mat image_;
  int x_ = 0, y_ = 0;
};

bool is_grey(const std::vector<Pixel>& palette) {
  return std::all_of(palette.begin(), palette.end(),
                     [](const Pixel& colour) { return colour[0] == colour[1] && colour[1] == colour[2]; });
}

// The channels that the file has.
cv::Mat without_unused(const cv::Mat& bgra, const Header& header, const std::vector<Pixel>& palette) {
  if (header.bits > 8 && header.masks[3] != 0) return bgra;
  cv::Mat image(bgra.size(), header.bits <= 8 && is_grey(palette) ? CV_8UC1 : CV_8UC3);
  cv::mixChannels(bgra, image, image.channels() == 1 ? std::vector{0, 0} : std::vector{0, 0, 1, 1, 2, 2});
  return image;
}

}  // namespace

Result<StoredImage> decode_bmp(std::string_view bytes) {
  LIMN_TRY(const Header header, read_header(bytes));
  LIMN_TRY_STATUS(check(header));
  const Error too_short = damaged("BMP", bytes, "the file ends too early");
  if (header.pixels_at > bytes.size()) return too_short;
  const std::string_view pixels = bytes.substr(header.pixels_at);
  const auto width = static_cast<std::size_t>(header.width), height = static_cast<std::size_t>(header.height);
  const std::size_t needed = header.row_bytes() * (height - 1) + (width * header.bits + 7) / 8;
  // Two bytes hold at most 255 pixels of run lengths. (Those that are jumped over have none, but no known
  // program writes such an image.)
  const std::size_t least = header.is_run_length() ? needed / 255 : needed;
  if (pixels.size() < least) return too_short;
  const std::vector<Pixel> palette =
      header.bits <= 8 ? read_palette(bytes, header) : std::vector<Pixel>(1, Pixel());
  const cv::Mat bgra = header.is_run_length() ? RunLengths(pixels, header, palette).read()
                                              : read_plain(pixels, header, palette);
  if (bgra.empty()) return too_short;
  StoredImage image{without_unused(bgra, header, palette)};
  if (!header.is_top_down) cv::flip(image.samples, image.samples, 0);
  drop_empty_alpha(&image.samples);
  return image;
}

}  // namespace limn::image_formats
