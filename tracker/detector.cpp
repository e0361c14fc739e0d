#include "tracker/detector.h"

#include <algorithm>
#include <utility>

#include "tracker/identify.h"

namespace limn::tracker {
namespace {

double longest_side(const Detection& detection) {
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i)
    longest = std::max(longest, (detection.corners_px[i] - detection.corners_px[(i + 1) % 4]).norm());
  return longest;
}

Eigen::Vector2d centre(const Detection& detection) {
  const auto& c = detection.corners_px;
  return 0.25 * (c[0] + c[1] + c[2] + c[3]);
}

// Two readings of one black square.
bool is_same_square(const Detection& a, const Detection& b) {
  return (centre(a) - centre(b)).norm() < 0.15 * std::min(longest_side(a), longest_side(b));
}

void add_best_of_square(Detection detection, std::vector<Detection>* detections) {
  for (Detection& other : *detections) {
    if (!is_same_square(detection, other)) continue;
    if (detection.score > other.score) other = std::move(detection);
    return;
  }
  detections->push_back(std::move(detection));
}

}  // namespace

std::vector<Detection> Detector::detect(const cv::Mat& grey, const Lens* lens) {
  LIMN_CHECK(grey.empty() || grey.type() == CV_8UC1);
  std::vector<Detection> detections;
  if (grey.empty()) return detections;
  threshold_.apply(grey, options_.min_contrast, binary_);
  finder_.find(binary_, {options_.min_side_px}, quads_);
  for (const Quad& quad : quads_) {
    const auto refined = refiner_.refine(grey, quad, 0.7 * options_.min_contrast, lens);
    if (!refined) continue;
    const auto identity = identify(grey, *refined, families_);
    if (!identity) continue;
    Detection detection;
    detection.marker = identity->marker;
    detection.score = std::clamp(identity->score, 0.0, 1.0);
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t corner = (i + identity->first_corner) % 4;
      detection.corners_px[i] = refined->corners_px[corner];
      detection.corner_covariance[i] = refined->corner_covariance[corner];
    }
    add_best_of_square(std::move(detection), &detections);
  }
  return detections;
}

}  // namespace limn::tracker
