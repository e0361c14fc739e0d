#include <png.h>
#include <zlib.h>

#include <bit>
#include <csetjmp>
#include <new>
#include <opencv2/core.hpp>
#include <vector>

#include "core/image_encoder.h"
#include "core/result.h"

namespace limn {
namespace {

// libpng returns from an error by longjmp: functions that it may leave that way hold no objects with a
// destructor.
class PngWriter {
 public:
  PngWriter() {
    png_ =
        png_create_write_struct(PNG_LIBPNG_VER_STRING, this, on_error, [](png_structp, png_const_charp) {});
    LIMN_CHECK(png_ != nullptr);
    info_ = png_create_info_struct(png_);
    LIMN_CHECK(info_ != nullptr);
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;

  std::string write(const cv::Mat& image, std::optional<int> compression) {
    for (int y = 0; y < image.rows; ++y) rows_.push_back(const_cast<png_bytep>(image.ptr(y)));
    const bool is_written = write_all(image, compression);
    LIMN_CHECK(is_written);
    return std::move(bytes_);
  }

 private:
  [[noreturn]] static void on_error(png_structp png, png_const_charp) {
    std::longjmp(static_cast<PngWriter*>(png_get_error_ptr(png))->jump_, 1);
  }
  // An exception must not leave through libpng.
  static void append(png_structp png, png_bytep bytes, std::size_t count) {
    bool is_kept = true;
    try {
      static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(bytes), count);
    } catch (const std::bad_alloc&) {
      is_kept = false;
    }
    if (!is_kept) png_error(png, "no memory");
  }

  bool write_all(const cv::Mat& image, std::optional<int> compression) {
    if (setjmp(jump_) != 0) return false;
    png_set_write_fn(png_, &bytes_, append, nullptr);
    if (compression) {
      png_set_compression_level(png_, *compression);
    } else {
      png_set_filter(png_, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
      png_set_compression_level(png_, Z_BEST_SPEED);
      png_set_compression_strategy(png_, Z_RLE);
    }
    const int type = image.channels() == 1   ? PNG_COLOR_TYPE_GRAY
                     : image.channels() == 3 ? PNG_COLOR_TYPE_RGB
                                             : PNG_COLOR_TYPE_RGBA;
    png_set_IHDR(png_, info_, static_cast<png_uint_32>(image.cols), static_cast<png_uint_32>(image.rows),
                 image.depth() == CV_16U ? 16 : 8, type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png_, info_);
    png_set_bgr(png_);
    if (std::endian::native == std::endian::little) png_set_swap(png_);
    png_write_image(png_, rows_.data());
    png_write_end(png_, info_);
    return true;
  }

  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::jmp_buf jump_{};
  std::vector<png_bytep> rows_;
  std::string bytes_;
};

}  // namespace

std::string encode_png(const cv::Mat& image, std::optional<int> compression) {
  LIMN_CHECK(!image.empty() && (image.depth() == CV_8U || image.depth() == CV_16U) &&
             (image.channels() == 1 || image.channels() == 3 || image.channels() == 4));
  return PngWriter().write(image, compression);
}

}  // namespace limn
