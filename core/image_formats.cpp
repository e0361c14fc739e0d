#include "core/image_formats.h"

#include <opencv2/core.hpp>

#include "core/image_io.h"

namespace limn::image_formats {

Status check_size(long width, long height) {
  if (width < 1 || height < 1)
    return error("expected an image with pixels, found a size of {}x{}. Save it again.", width, height);
  if (width > k_max_image_side || height > k_max_image_side)
    return error("expected at most {} pixels a side, found {}x{}. Make it smaller.", k_max_image_side, width,
                 height);
  if (width * height > k_max_image_pixels)
    return error("expected at most {} million pixels, found {}x{}. Make it smaller.",
                 k_max_image_pixels / 1'000'000, width, height);
  return {};
}

Error damaged(std::string_view format, std::string_view bytes, std::string_view reason) {
  return error(
      "expected a complete {} image, found a truncated or damaged one ({} bytes{}{}). Copy or capture it "
      "again.",
      format, bytes.size(), reason.empty() ? "" : ": ", reason);
}

unsigned little_endian(std::string_view bytes, std::size_t at, std::size_t count) {
  unsigned value = 0;
  for (std::size_t i = count; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

void undo_multiplied_alpha(cv::Mat* bgra, int white) {
  for (int y = 0; y < bgra->rows; ++y)
    for (int x = 0; x < bgra->cols; ++x) {
      const auto divide = [&](auto* pixel) {
        for (int k = 0; k < 3 && pixel[3] > 0; ++k)
          pixel[k] = static_cast<std::remove_reference_t<decltype(*pixel)>>(
              std::min<long>(white, (2L * pixel[k] * white + pixel[3]) / (2L * pixel[3])));
      };
      if (bgra->depth() == CV_16U)
        divide(bgra->ptr<cv::Vec4w>(y)[x].val);
      else
        divide(bgra->ptr<cv::Vec4b>(y)[x].val);
    }
}

void drop_empty_alpha(cv::Mat* image) {
  if (image->channels() != 4) return;
  cv::Mat alpha;
  cv::extractChannel(*image, alpha, 3);
  if (cv::countNonZero(alpha) > 0) return;
  cv::Mat opaque(image->size(), CV_MAKETYPE(image->depth(), 3));
  cv::mixChannels(*image, opaque, {0, 0, 1, 1, 2, 2});
  *image = opaque;
}

}  // namespace limn::image_formats
