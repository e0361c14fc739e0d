#include "core/stereo.h"

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/result.h"

namespace limn {
namespace {

constexpr double k_gamma = 2.2;

// The display value of the mean of two lights, for each pair of display values.
const std::vector<std::uint8_t>& mean_table() {
  static const std::vector<std::uint8_t> table = [] {
    std::vector<std::uint8_t> means(256 * 256);
    for (int a = 0; a < 256; ++a)
      for (int b = 0; b < 256; ++b) {
        const double light = 0.5 * (std::pow(a / 255.0, k_gamma) + std::pow(b / 255.0, k_gamma));
        means[static_cast<std::size_t>(256 * a + b)] =
            cv::saturate_cast<std::uint8_t>(255 * std::pow(light, 1 / k_gamma));
      }
    return means;
  }();
  return table;
}

}  // namespace

cv::Mat packed(const EyeImages& images, StereoLayout layout, cv::Size size) {
  LIMN_CHECK(layout == StereoLayout::side_by_side || layout == StereoLayout::top_bottom);
  const bool beside = layout == StereoLayout::side_by_side;
  const cv::Size first =
      beside ? cv::Size(size.width / 2, size.height) : cv::Size(size.width, size.height / 2);
  const cv::Rect left({0, 0}, first);
  const cv::Rect right = beside ? cv::Rect(first.width, 0, size.width - first.width, size.height)
                                : cv::Rect(0, first.height, size.width, size.height - first.height);
  cv::Mat out(size, images.left.type());
  cv::resize(images.left, out(left), left.size(), 0, 0, cv::INTER_AREA);
  cv::resize(images.is_stereo() ? images.right : images.left, out(right), right.size(), 0, 0, cv::INTER_AREA);
  return out;
}

cv::Mat both(const EyeImages& images) {
  cv::Mat out;
  cv::hconcat(images.left, images.is_stereo() ? images.right : images.left, out);
  return out;
}

cv::Mat mean_light(const EyeImages& images) {
  if (!images.is_stereo()) return images.left;
  LIMN_CHECK(images.left.depth() == CV_8U && images.left.size() == images.right.size() &&
             images.left.type() == images.right.type());
  const std::vector<std::uint8_t>& table = mean_table();
  cv::Mat out(images.left.size(), images.left.type());
  const auto row_bytes = static_cast<std::size_t>(out.cols) * out.elemSize();
  for (int row = 0; row < out.rows; ++row) {
    const std::uint8_t* a = images.left.ptr(row);
    const std::uint8_t* b = images.right.ptr(row);
    std::uint8_t* to = out.ptr(row);
    for (std::size_t i = 0; i < row_bytes; ++i) to[i] = table[256U * a[i] + b[i]];
  }
  return out;
}

std::array<Imager, 2> eyes(const Imager& viewer, double apart_m) {
  std::array<Imager, 2> out{viewer, viewer};
  out[0].imager_from_world.translation.x() += 0.5 * apart_m;
  out[1].imager_from_world.translation.x() -= 0.5 * apart_m;
  return out;
}

}  // namespace limn
