#include "projector/light_levels.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace limn::projector {

cv::Mat light_of_display(const Rig& rig, const std::string& projector) {
  cv::Mat light(1, 256, CV_32FC3);
  const auto found = std::find_if(rig.responses.begin(), rig.responses.end(),
                                  [&](const ProjectorResponse& r) { return r.projector == projector; });
  for (int v = 0; v < 256; ++v) {
    const double at = v / 255.0;
    cv::Vec3f& bgr = light.at<cv::Vec3f>(v);
    bgr = cv::Vec3f::all(static_cast<float>(std::pow(at, k_display_gamma)));
    if (found == rig.responses.end()) continue;
    bgr = {static_cast<float>(lookup(found->blue, at)), static_cast<float>(lookup(found->green, at)),
           static_cast<float>(lookup(found->red, at))};
  }
  return light;
}

cv::Mat light_of_levels(const Rig& rig, const std::string& camera) {
  cv::Mat light(1, 256, CV_32F);
  const auto found = std::find_if(rig.camera_responses.begin(), rig.camera_responses.end(),
                                  [&](const CameraResponse& r) { return r.camera == camera; });
  const bool measured = found != rig.camera_responses.end() && found->light.size() == 256;
  for (int v = 0; v < 256; ++v)
    light.at<float>(v) = static_cast<float>(measured ? found->light[static_cast<std::size_t>(v)]
                                                     : linear_from_srgb(v / 255.0));
  return light;
}

cv::Mat luminance(const cv::Mat& light) {
  cv::Mat out;
  cv::transform(light, out, cv::Matx13f(0.0722F, 0.7152F, 0.2126F));
  return out;
}

}  // namespace limn::projector
