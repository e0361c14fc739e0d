#include <tiffio.h>

#include <algorithm>
#include <cstdarg>
#include <cstring>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/image_formats.h"
#include "core/image_io.h"

namespace limn::image_formats {
namespace {

constexpr tmsize_t k_max_allocation = tmsize_t{1} << 32;  // libtiff, for one strip or tile
constexpr std::size_t k_max_ratio = 20'000;  // no compression of levels makes data this much smaller

// The bytes of the file, and what libtiff complains about first.
struct Memory {
  std::string_view bytes;
  toff_t at = 0;
  std::string reason;
};

tmsize_t read_bytes(thandle_t handle, void* out, tmsize_t count) {
  Memory& memory = *static_cast<Memory*>(handle);
  if (memory.at >= memory.bytes.size()) return 0;
  const auto got = std::min<std::size_t>(static_cast<std::size_t>(count), memory.bytes.size() - memory.at);
  std::memcpy(out, memory.bytes.data() + memory.at, got);
  memory.at += got;
  return static_cast<tmsize_t>(got);
}

toff_t seek(thandle_t handle, toff_t offset, int whence) {
  Memory& memory = *static_cast<Memory*>(handle);
  memory.at = offset + (whence == SEEK_CUR ? memory.at : whence == SEEK_END ? memory.bytes.size() : 0);
  return memory.at;
}

int on_error(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  Memory& memory = *static_cast<Memory*>(user);
  char text[200];
  std::vsnprintf(text, sizeof text, format, arguments);
  if (memory.reason.empty()) memory.reason = text;
  return 1;
}

using Tiff = std::unique_ptr<TIFF, decltype(&TIFFClose)>;

Tiff open(Memory* memory) {
  const std::unique_ptr<TIFFOpenOptions, decltype(&TIFFOpenOptionsFree)> options(TIFFOpenOptionsAlloc(),
                                                                                 TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), on_error, memory);
  TIFFOpenOptionsSetWarningHandlerExtR(
      options.get(), [](TIFF*, void*, const char*, const char*, va_list) { return 1; }, nullptr);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), k_max_allocation);
  const auto no_write = [](thandle_t, void*, tmsize_t) -> tmsize_t { return 0; };
  const auto close = [](thandle_t) { return 0; };
  const auto size = [](thandle_t handle) -> toff_t { return static_cast<Memory*>(handle)->bytes.size(); };
  return {TIFFClientOpenExt("image", "rm", memory, read_bytes, no_write, seek, close, size, nullptr, nullptr,
                            options.get()),
          TIFFClose};
}

struct Header {
  std::uint32_t width = 0, height = 0, subfile = 0;
  std::uint16_t bits = 1, samples = 1, colours = 0, planes = PLANARCONFIG_CONTIG, format = SAMPLEFORMAT_UINT;
  int alpha = -1;  // the sample that is alpha; -1: none
  bool is_alpha_multiplied = false;

  bool is_grey() const { return colours == PHOTOMETRIC_MINISBLACK || colours == PHOTOMETRIC_MINISWHITE; }
  int colour_samples() const { return is_grey() ? 1 : 3; }
  // Whether its samples are levels, which are read as they are. libtiff converts all others to RGBA.
  bool has_levels() const { return (is_grey() || colours == PHOTOMETRIC_RGB) && bits >= 8; }
};

Header read_header(TIFF* tiff) {
  Header header;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &header.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &header.height);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SUBFILETYPE, &header.subfile);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &header.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &header.samples);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &header.planes);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &header.format);
  if (TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &header.colours) == 0)
    header.colours = header.samples >= 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK;
  std::uint16_t extra_count = 0, *extra = nullptr;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_EXTRASAMPLES, &extra_count, &extra);
  for (int i = 0; i < extra_count && header.alpha < 0; ++i) {
    // One sample of no stated kind is alpha in practice.
    const bool is_alpha = extra[i] == EXTRASAMPLE_ASSOCALPHA || extra[i] == EXTRASAMPLE_UNASSALPHA ||
                          (extra[i] == EXTRASAMPLE_UNSPECIFIED && extra_count == 1);
    if (!is_alpha) continue;
    header.alpha = header.colour_samples() + i;
    header.is_alpha_multiplied = extra[i] == EXTRASAMPLE_ASSOCALPHA;
  }
  return header;
}

Status check(const Header& header) {
  if ((header.subfile & FILETYPE_REDUCEDIMAGE) != 0 || header.colours == PHOTOMETRIC_CFA)
    return error(
        "expected an image, found a camera's raw file (or a TIFF that begins with a preview). Develop it, "
        "and "
        "save it as PNG or TIFF.");
  if (header.format != SAMPLEFORMAT_UINT && header.format != SAMPLEFORMAT_VOID)
    return error("expected a TIFF of whole numbers, found {} numbers. Save it with 8 or 16 bits.",
                 header.format == SAMPLEFORMAT_INT ? "signed" : "floating-point");
  const bool is_read = header.has_levels()
                           ? header.bits <= 16 && header.samples <= 8 &&
                                 header.samples >= header.colour_samples() && header.alpha < header.samples
                           : header.bits <= 8;
  if (!is_read)
    return error(
        "expected a TIFF of 1 to 16 bits and at most 8 samples a pixel, found {} bits and {} samples "
        "(photometric interpretation {}). Save it as PNG.",
        header.bits, header.samples, header.colours);
  return {};
}

// One row of samples as stored, from packed bits to whole numbers.
void unpack(const std::uint8_t* row, int bits, int count, std::uint16_t* out) {
  if (bits == 8) {
    std::copy(row, row + count, out);
  } else if (bits == 16) {
    std::memcpy(out, row, 2 * static_cast<std::size_t>(count));  // libtiff has put the bytes in order
  } else {
    unsigned held = 0;
    int held_bits = 0;
    for (int i = 0; i < count; ++i) {
      for (; held_bits < bits; held_bits += 8) held = held << 8 | *row++;
      held_bits -= bits;
      out[i] = static_cast<std::uint16_t>(held >> held_bits & ((1u << bits) - 1));
    }
  }
}

// Reads strips and tiles of levels into `samples`: 16 bits, all samples of a pixel side by side.
class LevelReader {
 public:
  LevelReader(TIFF* tiff, const Header& header, std::size_t file_bytes)
      : tiff_(tiff), header_(header), file_bytes_(file_bytes) {
    if (TIFFIsTiled(tiff)) {
      TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &block_width_);
      TIFFGetField(tiff, TIFFTAG_TILELENGTH, &block_height_);
    } else {
      block_width_ = header.width;
      TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &block_height_);
      block_height_ = std::clamp(block_height_, 1u, header.height);
    }
  }

  bool read(cv::Mat* samples) {
    if (block_width_ == 0 || block_height_ == 0) return false;
    const tmsize_t size = TIFFIsTiled(tiff_) ? TIFFTileSize(tiff_) : TIFFStripSize(tiff_);
    if (size <= 0 || static_cast<std::size_t>(size) / k_max_ratio > file_bytes_) return false;
    block_.resize(static_cast<std::size_t>(size));
    const int planes = header_.planes == PLANARCONFIG_SEPARATE ? header_.samples : 1;
    for (int plane = 0; plane < planes; ++plane)
      for (std::uint32_t y = 0; y < header_.height; y += block_height_)
        for (std::uint32_t x = 0; x < header_.width; x += block_width_)
          if (!read_block(x, y, plane, samples)) return false;
    return true;
  }

 private:
  bool read_block(std::uint32_t x, std::uint32_t y, int plane, cv::Mat* samples) {
    const bool is_separate = header_.planes == PLANARCONFIG_SEPARATE;
    const int in_pixel = is_separate ? 1 : header_.samples;
    const std::uint32_t rows = std::min(block_height_, header_.height - y);
    const int row_samples = static_cast<int>(block_width_) * in_pixel;
    const std::size_t row_bytes =
        (static_cast<std::size_t>(row_samples) * static_cast<std::size_t>(header_.bits) + 7) / 8;
    const auto sample = static_cast<std::uint16_t>(plane);
    const tmsize_t got =
        TIFFIsTiled(tiff_)
            ? TIFFReadEncodedTile(tiff_, TIFFComputeTile(tiff_, x, y, 0, sample), block_.data(), -1)
            : TIFFReadEncodedStrip(tiff_, TIFFComputeStrip(tiff_, y, sample), block_.data(), -1);
    if (got < 0 || static_cast<std::size_t>(got) < rows * row_bytes || rows * row_bytes > block_.size())
      return false;
    row_.resize(static_cast<std::size_t>(row_samples));
    const int columns = static_cast<int>(std::min(block_width_, header_.width - x));
    for (std::uint32_t i = 0; i < rows; ++i) {
      unpack(block_.data() + i * row_bytes, header_.bits, row_samples, row_.data());
      auto* out = samples->ptr<std::uint16_t>(static_cast<int>(y + i)) + x * header_.samples;
      for (int k = 0; k < columns; ++k)
        if (is_separate)
          out[k * header_.samples + plane] = row_[static_cast<std::size_t>(k)];
        else
          std::copy_n(&row_[static_cast<std::size_t>(k * in_pixel)], in_pixel, out + k * in_pixel);
    }
    return true;
  }

  TIFF* tiff_;
  Header header_;
  std::size_t file_bytes_;
  std::uint32_t block_width_ = 0, block_height_ = 0;
  std::vector<std::uint8_t> block_;
  std::vector<std::uint16_t> row_;
};

// The samples that the image has, in the order blue, green, red, alpha.
cv::Mat in_order(const cv::Mat& samples, const Header& header) {
  const int colours = header.colour_samples(), channels = header.alpha < 0 ? colours : 4;
  cv::Mat image(samples.size(), CV_16UC(channels));
  std::vector<int> from_to;
  for (int k = 0; k < std::min(channels, 3); ++k) {
    from_to.push_back(colours == 1 ? 0 : 2 - k);
    from_to.push_back(k);
  }
  if (channels == 4) from_to.insert(from_to.end(), {header.alpha, 3});
  cv::mixChannels(samples, image, from_to);
  return image;
}

Result<StoredImage> read_levels(TIFF* tiff, const Header& header, const Memory& memory) {
  cv::Mat samples(static_cast<int>(header.height), static_cast<int>(header.width), CV_16UC(header.samples));
  if (!LevelReader(tiff, header, memory.bytes.size()).read(&samples))
    return damaged("TIFF", memory.bytes, memory.reason);
  StoredImage image{in_order(samples, header), (1 << header.bits) - 1, header.bits < 16};
  if (header.colours == PHOTOMETRIC_MINISWHITE) {
    const cv::Scalar white = cv::Scalar::all(image.white);
    cv::Mat inverted;
    cv::subtract(white, image.samples, inverted);
    if (header.alpha >= 0) cv::mixChannels(image.samples, inverted, {3, 3});
    image.samples = inverted;
  }
  drop_empty_alpha(&image.samples);
  if (header.is_alpha_multiplied && image.samples.channels() == 4)
    undo_multiplied_alpha(&image.samples, image.white);
  if (header.bits == 8) image.samples.convertTo(image.samples, CV_8U);
  return image;
}

// libtiff converts palettes, few bits, CMYK, YCbCr and Lab.
Result<StoredImage> read_converted(TIFF* tiff, const Header& header, Memory* memory) {
  TIFFRGBAImage converter;
  char reason[1024] = "";
  if (!TIFFRGBAImageBegin(&converter, tiff, 1, reason)) return damaged("TIFF", memory->bytes, reason);
  converter.req_orientation = converter.orientation;  // rows and columns as stored
  cv::Mat rgba(static_cast<int>(header.height), static_cast<int>(header.width), CV_8UC4);
  memory->reason.clear();
  const int done = TIFFRGBAImageGet(&converter, rgba.ptr<std::uint32_t>(), header.width, header.height);
  TIFFRGBAImageEnd(&converter);
  // After some errors in the data the rest is white, and no failure is returned.
  if (!done || !memory->reason.empty()) return damaged("TIFF", memory->bytes, memory->reason);
  StoredImage image;
  cv::cvtColor(rgba, image.samples, cv::COLOR_RGBA2BGR);
  if (header.is_grey()) cv::extractChannel(rgba, image.samples, 0);
  return image;
}

// Whether the file has a second image that is no preview and no mask of the first.
bool has_more_pages(TIFF* tiff) {
  while (TIFFReadDirectory(tiff))
    if ((read_header(tiff).subfile & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0) return true;
  return false;
}

}  // namespace

Result<StoredImage> decode_tiff(std::string_view bytes) {
  Memory memory{bytes, 0, {}};
  const Tiff tiff = open(&memory);
  if (!tiff) return damaged("TIFF", bytes, memory.reason);
  const Header header = read_header(tiff.get());
  LIMN_TRY_STATUS(check_size(header.width, header.height));
  LIMN_TRY_STATUS(check(header));
  if (static_cast<long>(header.width) * header.height * header.samples > 4 * k_max_image_pixels)
    return error(
        "expected at most 4 samples for each of {} million pixels, found {}x{} of {}. Make it smaller.",
        k_max_image_pixels / 1'000'000, header.width, header.height, header.samples);
  LIMN_TRY(StoredImage image, header.has_levels() ? read_levels(tiff.get(), header, memory)
                                                  : read_converted(tiff.get(), header, &memory));
  if (has_more_pages(tiff.get())) image.note = "holds several pages; the first one is read";
  return image;
}

}  // namespace limn::image_formats
