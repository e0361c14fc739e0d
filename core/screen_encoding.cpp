#include "core/screen_encoding.h"

#include <algorithm>
#include <opencv2/core.hpp>

#include "core/photometric_response.h"

namespace limn {

cv::Mat srgb_image(const cv::Mat& linear) {
  static const cv::Mat table = [] {
    cv::Mat values(1, 256, CV_8UC1);
    for (int i = 0; i < 256; ++i)
      values.at<std::uint8_t>(0, i) = cv::saturate_cast<std::uint8_t>(255 * srgb_from_linear(i / 255.0));
    return values;
  }();
  cv::Mat out;
  cv::LUT(linear, table, out);
  return out;
}

bool is_measured_linear(const Rig& rig, const Imager& camera) {
  return std::any_of(rig.camera_responses.begin(), rig.camera_responses.end(), [&](const CameraResponse& r) {
    return r.camera == camera.name && r.encoding == CameraEncoding::linear;
  });
}

}  // namespace limn
