#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstring>
#include <opencv2/core.hpp>
#include <vector>

#include "core/image_formats.h"

namespace limn::image_formats {
namespace {

constexpr std::size_t k_ihdr_end = 8 + 25;         // signature, length + "IHDR" + 13 bytes + CRC
constexpr png_alloc_size_t k_max_chunk = 1 << 26;  // enough for a colour profile or a text

unsigned big_endian_32(std::string_view bytes, std::size_t at) {
  unsigned value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

// libpng returns from an error by longjmp: functions that it may leave that way hold no objects with a
// destructor.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, [](png_structp, png_const_charp) {});
    LIMN_CHECK(png_ != nullptr);
    info_ = png_create_info_struct(png_);
    LIMN_CHECK(info_ != nullptr);
  }
  ~Reader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  Result<StoredImage> read(bool grey) {
    if (!read_header(grey)) return damaged("PNG", bytes_, reason_);
    const int depth = png_get_bit_depth(png_, info_) == 16 ? CV_16U : CV_8U;
    const int height = static_cast<int>(png_get_image_height(png_, info_));
    const int width = static_cast<int>(png_get_image_width(png_, info_));
    StoredImage image{cv::Mat(height, width, CV_MAKETYPE(depth, png_get_channels(png_, info_)))};
    for (int y = 0; y < height; ++y) rows_.push_back(image.samples.ptr(y));
    if (!read_rows()) return damaged("PNG", bytes_, reason_);
    image.is_stated = depth == CV_8U;
    image.white = depth == CV_8U ? 255 : 65535;
    return image;
  }

 private:
  [[noreturn]] static void on_error(png_structp png, png_const_charp message) {
    Reader& reader = *static_cast<Reader*>(png_get_error_ptr(png));
    std::snprintf(reader.reason_, sizeof reader.reason_, "%s", message);
    std::longjmp(reader.jump_, 1);
  }

  static void read_bytes(png_structp png, png_bytep out, std::size_t count) {
    Reader& reader = *static_cast<Reader*>(png_get_io_ptr(png));
    if (count > reader.bytes_.size() - reader.at_) png_error(png, "the file ends too early");
    std::memcpy(out, reader.bytes_.data() + reader.at_, count);
    reader.at_ += count;
  }

  bool read_header(bool grey) {
    if (setjmp(jump_) != 0) return false;
    png_set_read_fn(png_, this, read_bytes);
    png_set_chunk_malloc_max(png_, k_max_chunk);
    png_read_info(png_, info_);
    const bool has_colour = (png_get_color_type(png_, info_) & PNG_COLOR_MASK_COLOR) != 0;
    const bool has_alpha = (png_get_color_type(png_, info_) & PNG_COLOR_MASK_ALPHA) != 0 ||
                           png_get_valid(png_, info_, PNG_INFO_tRNS) != 0;
    png_set_expand(png_);  // palettes, 1 to 4 bits, and a transparent colour
    png_set_bgr(png_);
    if (std::endian::native == std::endian::little) png_set_swap(png_);
    if (has_alpha && !has_colour) png_set_gray_to_rgb(png_);
    if (grey && has_colour && !has_alpha) png_set_rgb_to_gray(png_, PNG_ERROR_ACTION_NONE, 0.299, 0.587);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }

  bool read_rows() {
    if (setjmp(jump_) != 0) return false;
    png_read_image(png_, rows_.data());
    png_read_end(png_, nullptr);
    return true;
  }

  std::string_view bytes_;
  std::size_t at_ = 0;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::jmp_buf jump_{};
  char reason_[120] = "";
  std::vector<png_bytep> rows_;
};

}  // namespace

Result<StoredImage> decode_png(std::string_view bytes, bool grey) {
  if (bytes.size() < k_ihdr_end) return damaged("PNG", bytes, "the file ends too early");
  LIMN_TRY_STATUS(check_size(big_endian_32(bytes, 16), big_endian_32(bytes, 20)));
  return Reader(bytes).read(grey);
}

}  // namespace limn::image_formats
