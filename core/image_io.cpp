#include "core/image_io.h"

#include <algorithm>
#include <array>
#include <bit>
#include <bitset>
#include <cctype>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/image_encoder.h"
#include "core/image_formats.h"
#include "core/log.h"

namespace limn {
namespace {

namespace fs = std::filesystem;
using image_formats::Format;
using image_formats::StoredImage;

constexpr std::array k_extensions = {".png", ".jpg", ".jpeg", ".jpe",  ".pbm",  ".pgm", ".ppm",
                                     ".pnm", ".bmp", ".tif",  ".tiff", ".webp", ".tga"};

std::optional<Format> format_of(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return Format::png;
  if (bytes.starts_with("\xff\xd8\xff")) return Format::jpeg;
  if (bytes.size() > 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
      std::isspace(static_cast<unsigned char>(bytes[2])))
    return Format::pnm;
  if (bytes.starts_with("BM")) return Format::bmp;
  for (const std::string_view tiff : {"II*\0", "MM\0*", "II+\0", "MM\0+"})
    if (bytes.starts_with(std::string_view(tiff.data(), 4))) return Format::tiff;
  if (bytes.starts_with("RIFF") && bytes.substr(std::min<std::size_t>(8, bytes.size())).starts_with("WEBP"))
    return Format::webp;
  if (image_formats::is_tga(bytes)) return Format::tga;
  return std::nullopt;
}

// What a file of another format is, for the message.
std::string foreign_format(std::string_view bytes) {
  struct Signature {
    std::size_t at;
    std::string_view bytes;
    const char* name;
  };
  static constexpr std::array k_known = {
      Signature{0, "GIF8", "a GIF"},
      Signature{0, std::string_view("\0\0\1\0", 4), "an icon (ICO)"},
      Signature{4, "ftypheic", "a HEIC photograph"},
      Signature{4, "ftypheix", "a HEIC photograph"},
      Signature{4, "ftypmif1", "a HEIF or AVIF photograph"},
      Signature{4, "ftypavif", "an AVIF photograph"},
      Signature{4, "ftyp", "a video or a camera's raw file"},
      Signature{0, "\xff\x0a", "a JPEG XL"},
      Signature{4, "JXL ", "a JPEG XL"},
      Signature{4, "jP  ", "a JPEG 2000"},
      Signature{0, "\xff\x4f\xff\x51", "a JPEG 2000"},
      Signature{0, "\x76\x2f\x31\x01", "an OpenEXR"},
      Signature{0, "#?RADIANCE", "a Radiance HDR"},
      Signature{0, "8BPS", "a Photoshop file"},
      Signature{0, "%PDF", "a PDF"},
      Signature{0, "P7\n", "a PAM"},
      Signature{0, "PF\n", "a PFM"},
      Signature{0, "Pf\n", "a PFM"},
      Signature{0, "DDS ", "a DDS"},
      Signature{0, "<svg", "an SVG"},
      Signature{0, "version https://git-lfs", "a pointer of Git LFS instead of the file"},
  };
  if (bytes.empty()) return "an empty file";
  for (const Signature& known : k_known)
    if (bytes.size() > known.at && bytes.substr(known.at).starts_with(known.bytes)) return known.name;
  return fmt::format("{} other bytes", bytes.size());
}

Result<StoredImage> decoded(std::string_view bytes, bool grey) {
  const auto format = format_of(bytes);
  if (!format)
    return error("expected a PNG, JPEG, PGM, PPM, BMP, TIFF, WebP or TGA image, found {}. Save it as PNG.",
                 foreign_format(bytes));
  switch (*format) {
    case Format::png:
      return image_formats::decode_png(bytes, grey);
    case Format::jpeg:
      return image_formats::decode_jpeg(bytes, grey);
    case Format::pnm:
      return image_formats::decode_pnm(bytes);
    case Format::bmp:
      return image_formats::decode_bmp(bytes);
    case Format::tiff:
      return image_formats::decode_tiff(bytes);
    case Format::webp:
      return image_formats::decode_webp(bytes);
    case Format::tga:
      break;
  }
  return image_formats::decode_tga(bytes);
}

// The rule of find_used_bits(). An image with alpha comes from no camera.
int used_bits_of(const StoredImage& image) {
  if (image.is_stated || image.samples.channels() == 4) return k_full_range;
  int brightest = 0;
  bool all_64 = true, all_257 = true;
  std::bitset<1024> levels;  // used if all samples are multiples of 64
  for (int y = 0; y < image.samples.rows; ++y) {
    const auto* row = image.samples.ptr<std::uint16_t>(y);
    const int count = image.samples.cols * image.samples.channels();
    for (int k = 0; k < count; ++k) {
      brightest = std::max<int>(brightest, row[k]);
      all_64 = all_64 && row[k] % 64 == 0;
      levels.set(row[k] / 64);
      all_257 = all_257 && row[k] % 257 == 0;
    }
  }
  // A drawing of few levels at the low end may have multiples of 64 alone.
  constexpr std::size_t k_least_levels = 8;
  if (all_257 || (all_64 && levels.count() >= k_least_levels)) return k_full_range;
  for (const int bits : {10, 12, 14})
    if (brightest < 1 << bits) return bits;
  return k_full_range;
}

// The highest eight of the lowest `bits` bits.
cv::Mat highest_bits(const cv::Mat& samples, int bits) {
  cv::Mat image(samples.size(), CV_8UC(samples.channels()));
  const int count = samples.cols * samples.channels();
  for (int y = 0; y < samples.rows; ++y) {
    const auto* in = samples.ptr<std::uint16_t>(y);
    auto* out = image.ptr<std::uint8_t>(y);
    for (int k = 0; k < count; ++k) out[k] = static_cast<std::uint8_t>(std::min(in[k] >> (bits - 8), 255));
  }
  return image;
}

// Levels of 0 to `white` as 8 bits.
cv::Mat as_8_bits(const StoredImage& stored, int used_bits) {
  if (stored.samples.depth() == CV_8U && stored.white == 255) return stored.samples;
  if (stored.samples.depth() == CV_16U) {
    if (!stored.is_stated)
      return highest_bits(stored.samples, used_bits == k_found_in_image ? used_bits_of(stored) : used_bits);
    const auto levels = static_cast<unsigned>(stored.white) + 1;
    if (std::has_single_bit(levels)) return highest_bits(stored.samples, std::countr_zero(levels));
  }
  cv::Mat image;
  stored.samples.convertTo(image, CV_8U, 255.0 / stored.white);
  return image;
}

cv::Mat on_white(const cv::Mat& bgra) {
  cv::Mat bgr(bgra.size(), CV_8UC3);
  for (int y = 0; y < bgra.rows; ++y) {
    const auto* in = bgra.ptr<cv::Vec4b>(y);
    auto* out = bgr.ptr<cv::Vec3b>(y);
    for (int x = 0; x < bgra.cols; ++x)
      for (int k = 0; k < 3; ++k)
        out[x][k] = static_cast<std::uint8_t>((in[x][k] * in[x][3] + 255 * (255 - in[x][3]) + 127) / 255);
  }
  return bgr;
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

std::string base64(std::string_view bytes) {
  static constexpr char k_digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t at = 0; at < bytes.size(); at += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - at);
    std::uint32_t group = 0;
    for (std::size_t i = 0; i < 3; ++i)
      group = group << 8 | (i < count ? static_cast<unsigned char>(bytes[at + i]) : 0u);
    for (std::size_t i = 0; i < 4; ++i) text += i <= count ? k_digits[group >> (18 - 6 * i) & 63] : '=';
  }
  return text;
}

constexpr std::size_t k_behind_ihdr = 8 + 25;  // signature, then length + "IHDR" + 13 bytes + CRC

}  // namespace

Result<cv::Mat> decode_image(std::string_view bytes, const std::string& name, const ImageOptions& options) {
  const auto stored = decoded(bytes, options.grey);
  if (!stored) return error("{}: {}", name, stored.message());
  if (!stored->note.empty()) log_warning("{}: {}", name, stored->note);
  cv::Mat image = as_8_bits(*stored, options.used_bits);
  if (image.channels() == 4 && options.alpha == Alpha::ignored)
    cv::cvtColor(image, image, cv::COLOR_BGRA2BGR);
  else if (image.channels() == 4 && (options.grey || options.alpha == Alpha::on_white))
    image = on_white(image);
  return options.grey ? to_grey(image) : image;
}

Result<cv::Mat> read_image(const fs::path& path, const ImageOptions& options) {
  LIMN_TRY(const std::string bytes, read_file(path));
  return decode_image(bytes, path.string(), options);
}

Result<cv::Mat> read_image_with_alpha(const fs::path& path) {
  return read_image(path, {.alpha = Alpha::kept});
}

Result<cv::Mat> read_grey_image(const fs::path& path, int used_bits) {
  return read_image(path, {.grey = true, .used_bits = used_bits});
}

Result<int> find_used_bits(const fs::path& path) {
  LIMN_TRY(const std::string bytes, read_file(path));
  const auto format = format_of(bytes);
  constexpr std::size_t k_png_bits = 24;  // offset of the bit depth in a PNG
  const bool is_16_bit_png = format == Format::png && bytes.size() > k_png_bits && bytes[k_png_bits] == 16;
  if (!is_16_bit_png && format != Format::tiff && format != Format::pnm) return k_full_range;
  const auto stored = decoded(bytes, true);
  if (!stored) return error("{}: {}", path.string(), stored.message());
  return used_bits_of(*stored);
}

bool is_image_name(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(k_extensions.begin(), k_extensions.end(), extension) != k_extensions.end();
}

fs::path find_image(const fs::path& path) {
  std::error_code ignored;
  if (fs::exists(path, ignored)) return path;
  for (std::string extension : k_extensions)
    for (const bool in_capitals : {false, true}) {
      if (in_capitals) std::transform(extension.begin(), extension.end(), extension.begin(), ::toupper);
      fs::path other = path;
      other.replace_extension(extension);
      if (fs::exists(other, ignored)) return other;
    }
  return path;
}

cv::Mat to_grey(const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, image.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  return grey;
}

Status write_png(const fs::path& path, const cv::Mat& image, const PngOptions& options) {
  LIMN_CHECK(!image.empty());
  std::string bytes = options.compression == 1 ? encode_png(image) : encode_png(image, options.compression);
  if (options.pixels_per_metre > 0)
    bytes.insert(k_behind_ihdr, physical_size_chunk(options.pixels_per_metre));
  return write_file(path, bytes);
}

std::string data_uri(const cv::Mat& image) {
  return "data:image/jpeg;base64," + base64(encode_jpeg(image, 90));
}

}  // namespace limn
