#include "calib/response/colour_mixing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>

namespace limn::calib {
namespace {

using Role = ResponseImage::Role;

// Sum of squared light over a channel's ramp: its darkest fifth alone determines nothing.
constexpr double k_least_sum = 0.02;

// Normal equations of offset + three factors: each image shows one channel, so the matrix is an arrow.
struct Arrow {
  double weight = 0, light = 0;                        // sums of w, w y
  std::array<double, 3> first{}, second{}, product{};  // sums of w f, w f f, w f y, for each channel

  void add(int channel, double f, double y, double w) {
    weight += w;
    light += w * y;
    if (channel < 0) return;
    const auto c = static_cast<size_t>(channel);
    first[c] += w * f;
    second[c] += w * f * f;
    product[c] += w * f * y;
  }

  // Offset, blue, green, red; NaN when a channel was hardly seen.
  std::array<float, 4> solved(double unit_weight) const {
    std::array<float, 4> x;
    x.fill(std::numeric_limits<float>::quiet_NaN());
    double diagonal = weight, side = light;
    for (size_t c = 0; c < 3; ++c) {
      if (!(second[c] > k_least_sum * unit_weight)) return x;
      diagonal -= first[c] * first[c] / second[c];
      side -= first[c] * product[c] / second[c];
    }
    if (!(diagonal > 1e-9 * weight)) return x;
    const double offset = side / diagonal;
    x[0] = static_cast<float>(offset);
    for (size_t c = 0; c < 3; ++c)
      x[c + 1] = static_cast<float>((product[c] - first[c] * offset) / second[c]);
    return x;
  }
};

struct ShownImage {
  size_t image = 0;
  int channel = -1;  // channel of a ramp
  double light = 0;
};

std::vector<ShownImage> shown_images(const ProjectorResponse& projector) {
  std::vector<ShownImage> shown;
  for (const size_t image : images_of(Role::black)) shown.push_back({image, -1, 0});
  for (int c = 0; c < 3; ++c)
    for (const size_t image : ramp_of(c))
      shown.push_back({image, c, light_over_black(projector, c, response_images()[image].bgr[c])});
  return shown;
}

// RMS of predicted minus photographed over the check colours, where the projector's light is visible and
// unclipped.
double held_out_rms(const ResponseShots& shots,
                    const ColourMixing& mixing,
                    const ProjectorResponse& projector,
                    const CameraResponse& camera) {
  const cv::Mat black = shots.images[images_of(Role::black)[0]].reshape(1);
  const cv::Mat white = shots.images[images_of(Role::white)[0]].reshape(1);
  double squares = 0, count = 0;
  for (const size_t image : images_of(Role::check)) {
    const cv::Mat predicted =
        predicted_photograph(mixing, projector, camera, response_images()[image].bgr).reshape(1);
    const cv::Mat taken = shots.images[image].reshape(1);
    for (int r = 0; r < taken.rows; ++r)
      for (int c = 0; c < taken.cols; ++c) {
        constexpr int k_lit = 10;  // levels
        if (white.at<uchar>(r, c) - black.at<uchar>(r, c) < k_lit || taken.at<uchar>(r, c) >= k_clipped)
          continue;
        const double off = predicted.at<float>(r, c) - taken.at<uchar>(r, c);
        if (std::isnan(off)) continue;
        squares += off * off;
        count += 1;
      }
  }
  return count > 0 ? std::sqrt(squares / count) : 0;
}

}  // namespace

ColourMixing fitted_mixing(const ResponseShots& shots,
                           const ProjectorResponse& projector,
                           const CameraResponse& camera) {
  const Decoding decode = decoding(camera);
  const std::vector<ShownImage> shown = shown_images(projector);
  const cv::Mat& first = shots.images[0];
  ColourMixing mixing{projector.projector, camera.camera, {}, {}, {}, {}, 0};
  const std::array<cv::Mat*, 4> maps = {&mixing.offset, &mixing.blue, &mixing.green, &mixing.red};
  for (cv::Mat* map : maps) map->create(first.size(), CV_MAKETYPE(CV_32F, first.channels()));
  const double least_weight = *std::min_element(decode.weight.begin(), decode.weight.begin() + k_clipped);
  cv::parallel_for_({0, first.rows}, [&](const cv::Range& rows) {
    for (int r = rows.start; r < rows.end; ++r)
      for (int c = 0; c < first.cols * first.channels(); ++c) {
        Arrow arrow;
        for (const ShownImage& s : shown) {
          const uchar level = shots.images[s.image].ptr(r)[c];
          arrow.add(s.channel, s.light, decode.light[level], decode.weight[level]);
        }
        const std::array<float, 4> x = arrow.solved(least_weight);
        for (size_t i = 0; i < maps.size(); ++i) maps[i]->ptr<float>(r)[c] = x[i];
      }
  });
  mixing.held_out_levels = held_out_rms(shots, mixing, projector, camera);
  return mixing;
}

cv::Mat predicted_photograph(const ColourMixing& mixing,
                             const ProjectorResponse& projector,
                             const CameraResponse& camera,
                             const cv::Vec3b& bgr) {
  const auto share = [&](int channel) { return light_over_black(projector, channel, bgr[channel]); };
  cv::Mat light = mixing.offset + share(0) * mixing.blue + share(1) * mixing.green + share(2) * mixing.red;
  cv::Mat values = light.reshape(1);
  for (auto& value : cv::Mat_<float>(values))
    if (!std::isnan(value)) value = static_cast<float>(255 * inverse_lookup(camera.light, value));
  return light;
}

}  // namespace limn::calib
