#include "apps/camera_encoding.h"

#include <algorithm>
#include <opencv2/core.hpp>

namespace limn::apps {

tracker::Encoding encoding_of(const Rig& rig, const Imager& camera) {
  for (const CameraResponse& response : rig.camera_responses) {
    if (response.camera != camera.name) continue;
    const double middle = looked_up(response.light, 0.5);  // linear 0.5, sRGB 0.21
    return middle < 0.5 * (0.5 + linear_of_srgb(0.5)) ? tracker::Encoding::srgb : tracker::Encoding::linear;
  }
  return tracker::Encoding::linear;
}

cv::Mat srgb_picture(const cv::Mat& linear) {
  static const cv::Mat table = [] {
    cv::Mat values(1, 256, CV_8UC1);
    for (int i = 0; i < 256; ++i)
      values.at<std::uint8_t>(0, i) = cv::saturate_cast<std::uint8_t>(255 * srgb_of_linear(i / 255.0));
    return values;
  }();
  cv::Mat out;
  cv::LUT(linear, table, out);
  return out;
}

bool is_measured_linear(const Rig& rig, const Imager& camera) {
  return std::any_of(rig.camera_responses.begin(), rig.camera_responses.end(), [&](const CameraResponse& r) {
    return r.camera == camera.name && r.encoding == "linear";
  });
}

}  // namespace limn::apps
