#include <turbojpeg.h>

#include <memory>
#include <opencv2/core.hpp>

#include "core/image_encoder.h"
#include "core/result.h"

namespace limn {

std::string encode_jpeg(const cv::Mat& image, int quality) {
  LIMN_CHECK(!image.empty() && (image.type() == CV_8UC1 || image.type() == CV_8UC3));
  const std::unique_ptr<void, int (*)(tjhandle)> encoder(tjInitCompress(), tjDestroy);
  LIMN_CHECK(encoder != nullptr);
  const bool grey = image.channels() == 1;
  const int sampling = grey ? TJSAMP_GRAY : TJSAMP_420;
  std::string jpeg(tjBufSize(image.cols, image.rows, sampling), '\0');
  auto* at = reinterpret_cast<unsigned char*>(jpeg.data());
  unsigned long size = jpeg.size();
  LIMN_CHECK(tjCompress2(encoder.get(), image.data, image.cols, static_cast<int>(image.step), image.rows,
                         grey ? TJPF_GRAY : TJPF_BGR, &at, &size, sampling, quality, TJFLAG_NOREALLOC) == 0);
  jpeg.resize(size);
  return jpeg;
}

}  // namespace limn
