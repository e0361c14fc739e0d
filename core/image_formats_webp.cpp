#include <webp/decode.h>

#include "core/image_formats.h"

namespace limn::image_formats {

Result<StoredImage> decode_webp(std::string_view bytes) {
  const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(data, bytes.size(), &features) != VP8_STATUS_OK) return damaged("WebP", bytes, "");
  LIMN_TRY_STATUS(check_size(features.width, features.height));
  if (features.has_animation)
    return error("expected one image, found a WebP animation. Save one frame of it.");
  StoredImage image{cv::Mat(features.height, features.width, features.has_alpha ? CV_8UC4 : CV_8UC3)};
  const auto decode = features.has_alpha ? WebPDecodeBGRAInto : WebPDecodeBGRInto;
  const std::size_t size = image.samples.total() * image.samples.elemSize();
  if (!decode(data, bytes.size(), image.samples.data, size, static_cast<int>(image.samples.step)))
    return damaged("WebP", bytes, "");
  return image;
}

}  // namespace limn::image_formats
