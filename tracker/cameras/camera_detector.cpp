#include "tracker/cameras/camera_detector.h"

#include <algorithm>
#include <utility>

#include "core/image_io.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {
namespace {

// While all of the scene's markers are seen, full searches are k_rarer times rarer. Only every
// k_covered_every-th search also looks for partly covered markers.
constexpr int k_rarer = 3;
constexpr int k_covered_every = 2;
// If the time between images grows by more than this factor, markers are not extrapolated.
constexpr double k_like_moments = 3;

// Whether a marker has moved by more than its corners' noise.
bool has_moved(const Detection& now, const Detection& before) {
  constexpr double k_deviations = 3;
  for (std::size_t i = 0; i < 4; ++i) {
    const double variance = (now.corner_covariance[i] + before.corner_covariance[i]).trace();
    if ((now.corners_px[i] - before.corners_px[i]).squaredNorm() > k_deviations * k_deviations * variance)
      return true;
  }
  return false;
}

// Predicts markers `seconds` ahead, with the image motion that they had in the `seconds_before`.
std::vector<Detection> predicted_detections(const std::vector<Detection>& last,
                                            const std::vector<Detection>& before,
                                            double seconds,
                                            double seconds_before) {
  std::vector<Detection> next = last;
  if (!(seconds_before > 0 && seconds > 0 && seconds < k_like_moments * seconds_before)) return next;
  for (Detection& marker : next) {
    const Detection* was = nullptr;  // the nearest earlier one with that name
    const auto moved = [&](const Detection& other) {
      return (marker.corners_px[0] - other.corners_px[0]).norm();
    };
    for (const Detection& other : before)
      if (other.marker == marker.marker && (!was || moved(other) < moved(*was))) was = &other;
    if (!was || !has_moved(marker, *was)) continue;
    for (std::size_t i = 0; i < 4; ++i)
      marker.corners_px[i] += seconds / seconds_before * (marker.corners_px[i] - was->corners_px[i]);
  }
  return next;
}

}  // namespace

CameraDetector::CameraDetector(const CameraDetectorSetup& setup,
                               const Lens& lens,
                               Encoding encoding,
                               std::uint64_t run)
    : lens_(lens),
      used_(setup.used),
      finds_balls_(setup.finds_balls),
      full_scan_every_(setup.full_scan_every),
      detector_(setup.families, {.encoding = encoding}),
      ball_finder_({.encoding = encoding}) {
  for (const auto& [marker, gesture] : setup.controls) gestures_.emplace_back(marker, gesture);
  newest_.run = run;
  newest_.controls.resize(gestures_.size());
}

const CameraDetections& CameraDetector::detect(const Frame& frame, const SeenElsewhere& seen_elsewhere) {
  newest_.camera = frame.camera;
  newest_.captured_at = frame.captured_at;
  grey_ = frame.grey.empty() ? to_grey(frame.image) : frame.grey;
  if (finds_balls_) newest_.balls = ball_finder_.find(grey_, lens_);
  if (!used_.empty()) find_markers(frame.captured_at, seen_elsewhere);
  for (std::size_t i = 0; i < gestures_.size(); ++i) {
    const int steps = gestures_[i].read(grey_, newest_.detections, frame.captured_at);
    GestureReading& reading = newest_.controls[i];
    reading.forward += std::max(steps, 0);
    reading.backward += std::max(-steps, 0);
    reading.is_seen = gestures_[i].is_seen();
    reading.hidden_since = gestures_[i].hidden_since();
  }
  return newest_;
}

// Follows known markers near their predicted positions. Searches the whole image for others from time to
// time, and when a marker is gone.
void CameraDetector::find_markers(Stamp captured_at, const SeenElsewhere& seen_elsewhere) {
  std::vector<Detection>& detections = newest_.detections;
  const double seconds = seconds_between(seen_at_, captured_at);
  const std::vector<Detection> next =
      predicted_detections(detections, before_, seconds, std::exchange(seconds_, seconds));
  seen_at_ = captured_at;
  std::swap(before_, detections);
  detector_.follow(grey_, &lens_, next, &detections);
  const bool is_one_gone = detections.size() < next.size();
  if (--until_search_ > 0 && !is_one_gone) return;
  const bool covered = searches_++ % k_covered_every == 0 || !all_are_seen(seen_elsewhere);
  detector_.detect_more(grey_, &lens_, &detections, covered ? Reading::covered : Reading::open);
  until_search_ = (all_are_seen(seen_elsewhere) ? k_rarer : 1) * full_scan_every_;
}

// Whether each marker that bodies and controls use is seen by some camera.
bool CameraDetector::all_are_seen(const SeenElsewhere& seen_elsewhere) const {
  return std::all_of(used_.begin(), used_.end(), [&](const MarkerName& used) {
    return std::any_of(newest_.detections.begin(), newest_.detections.end(),
                       [&](const Detection& detection) { return is_marker(detection.marker, used); }) ||
           (seen_elsewhere && seen_elsewhere(used));
  });
}

}  // namespace limn::tracker
