#include <csetjmp>
#include <cstdio>
#include <cstdlib>

// jpeglib.h needs <cstdio> before it.
#include <jpeglib.h>

#include <opencv2/core.hpp>

#include "core/image_encoder.h"
#include "core/result.h"

namespace limn {
namespace {

struct Jump {
  jpeg_error_mgr manager;  // libjpeg finds it by the address of this structure
  std::jmp_buf buffer;
};

// Writes into memory of malloc(). It holds no objects with a destructor, because libjpeg may leave it by
// longjmp. False: libjpeg failed, for want of memory or because a side is longer than 65500; the memory is
// then not freed, since libjpeg does not say where it is.
bool write_jpeg(const cv::Mat& image, int quality, unsigned char** bytes, unsigned long* count) {
  jpeg_compress_struct jpeg{};
  Jump jump{};
  jpeg.err = jpeg_std_error(&jump.manager);
  jump.manager.error_exit = [](j_common_ptr info) {
    std::longjmp(reinterpret_cast<Jump*>(info->err)->buffer, 1);
  };
  if (setjmp(jump.buffer) != 0) {
    jpeg_destroy_compress(&jpeg);
    return false;
  }
  jpeg_create_compress(&jpeg);
  jpeg_mem_dest(&jpeg, bytes, count);
  jpeg.image_width = static_cast<JDIMENSION>(image.cols);
  jpeg.image_height = static_cast<JDIMENSION>(image.rows);
  jpeg.input_components = image.channels();
  jpeg.in_color_space = image.channels() == 1 ? JCS_GRAYSCALE : JCS_EXT_BGR;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, quality, TRUE);
  jpeg_start_compress(&jpeg, TRUE);
  while (jpeg.next_scanline < jpeg.image_height) {
    auto* row = const_cast<JSAMPROW>(image.ptr(static_cast<int>(jpeg.next_scanline)));
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  return true;
}

}  // namespace

std::string encode_jpeg(const cv::Mat& image, int quality) {
  LIMN_CHECK(image.type() == CV_8UC1 || image.type() == CV_8UC3);
  unsigned char* bytes = nullptr;
  unsigned long count = 0;
  const bool is_written = write_jpeg(image, quality, &bytes, &count);
  std::string text;
  LIMN_CHECK(is_written);
  text.assign(reinterpret_cast<const char*>(bytes), count);
  std::free(bytes);
  return text;
}

}  // namespace limn
