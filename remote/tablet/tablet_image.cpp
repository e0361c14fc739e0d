#include "remote/tablet/tablet_image.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <vector>

#include "device/jpeg.h"

namespace limn::remote {
namespace {

// Scans of a progressive JPEG. Encoders write about ten; each costs a pass over the whole image.
constexpr int k_max_scans = 16;

// In coded image data 0xff is followed by 0. Only the bytes of other segments can make this count too high.
int scans_in(std::span<const std::uint8_t> jpeg) {
  int scans = 0;
  for (std::size_t i = 0; i + 1 < jpeg.size(); ++i) scans += jpeg[i] == 0xff && jpeg[i + 1] == 0xda;
  return scans;
}

}  // namespace

Result<cv::Mat> decode_tablet_image(std::span<const std::uint8_t> jpeg) {
  if (jpeg.size() > k_max_tablet_image_bytes)
    return error("expected a picture of at most {} MB, found {:.1f} MB. Send a smaller one.",
                 k_max_tablet_image_bytes >> 20, static_cast<double>(jpeg.size()) / (1 << 20));
  if (jpeg.size() < 4 || jpeg[0] != 0xff || jpeg[1] != 0xd8)
    return error("expected a JPEG picture, found {} bytes of something else.", jpeg.size());
  LIMN_TRY(const cv::Size size, device::jpeg_size(jpeg));
  if (std::max(size.width, size.height) > k_max_tablet_image_side)
    return error("expected a picture of at most {} pixels a side, found {}x{}. Send a smaller one.",
                 k_max_tablet_image_side, size.width, size.height);
  if (const int scans = scans_in(jpeg); scans > k_max_scans)
    return error("expected a picture of at most {} scans, found {}.", k_max_scans, scans);
  LIMN_TRY(cv::Mat image, device::decode_jpeg(jpeg, {.longest_side = k_drawn_side}));
  if (image.channels() == 3) return image;
  cv::Mat bgr;
  cv::merge(std::vector<cv::Mat>(3, image), bgr);
  return bgr;
}

}  // namespace limn::remote
