#include "device/jpeg.h"

#include <turbojpeg.h>

#include <memory>
#include <string>

namespace limn::device {
namespace {

constexpr long k_max_pixels = 200'000'000;  // of the largest sensors; more is a damaged header

// libjpeg carries on behind what it warns of: bytes between segments cost nothing, all else costs picture.
bool is_harmless(const std::string& warning) {
  return warning.find("extraneous bytes before marker") != std::string::npos;
}

}  // namespace

Result<cv::Mat> decode_jpeg(std::span<const std::uint8_t> bytes, const JpegOptions& options) {
  const std::unique_ptr<void, int (*)(tjhandle)> decoder(tjInitDecompress(), tjDestroy);
  LIMN_CHECK(decoder != nullptr);
  const auto damaged = [&] {
    return error("expected a whole JPEG picture, found a truncated or damaged one ({} bytes: {}).",
                 bytes.size(), tjGetErrorStr2(decoder.get()));
  };
  int width = 0, height = 0, subsampling = 0, colours = 0;
  if (tjDecompressHeader3(decoder.get(), bytes.data(), bytes.size(), &width, &height, &subsampling,
                          &colours) != 0)
    return damaged();
  if (!options.size.empty() && cv::Size(width, height) != options.size)
    return error("expected a picture of {}x{}, found {}x{}. Set the camera back or start again.",
                 options.size.width, options.size.height, width, height);
  if (static_cast<long>(width) * height > k_max_pixels)
    return error("expected a camera's picture, found one of {}x{} pixels.", width, height);
  const bool grey = options.grey || colours == TJCS_GRAY;
  cv::Mat picture(height, width, grey ? CV_8UC1 : CV_8UC3);
  if (tjDecompress2(decoder.get(), bytes.data(), bytes.size(), picture.data, width,
                    static_cast<int>(picture.step), height, grey ? TJPF_GRAY : TJPF_BGR, 0) != 0 &&
      !(tjGetErrorCode(decoder.get()) == TJERR_WARNING && is_harmless(tjGetErrorStr2(decoder.get()))))
    return damaged();
  return picture;
}

}  // namespace limn::device
