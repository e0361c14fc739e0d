#include "tracker/gesture.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/median.h"

namespace limn::tracker {
namespace {

constexpr double k_armed_s = 0.2;  // a marker must be seen this long before a gesture counts
constexpr double k_gap_s = 0.15;   // shorter absences are missed detections, not a hand
constexpr double k_rest_s = 0.1;   // a turn counts when the marker has rested this long
constexpr double k_rest_rad = 0.05;
constexpr double k_neighbour_sides = 5;  // radius in which an arm hides other markers as well
constexpr double k_memory_s = 3;
// Width of the patch that is checked for stillness; it contains a hand's outline.
constexpr double k_patch_sides = 3;
constexpr int k_patch_cells = 20;
constexpr int k_few_cells = 4;
constexpr double k_mostly = 2 / 3.0, k_alike = 0.1;  // k_alike: share of the marker's contrast
constexpr double k_noise_blend = 0.2, k_deviations_per_median = 1.4826, k_noise_deviations = 3;
constexpr double k_tremor = 1 / 25.0;  // movement of a resting hand, in sides of the marker

double direction(const Detection& detection) {
  const Eigen::Vector2d d =
      detection.corners_px[1] + detection.corners_px[2] - detection.corners_px[0] - detection.corners_px[3];
  return std::atan2(d.y(), d.x());
}

double wrapped(double angle) { return std::remainder(angle, 2 * std::numbers::pi); }

Eigen::Vector2d centre(const std::array<Eigen::Vector2d, 4>& corners) {
  return 0.25 * (corners[0] + corners[1] + corners[2] + corners[3]);
}

double area(const std::array<Eigen::Vector2d, 4>& corners) {
  double twice = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d &a = corners[i], &b = corners[(i + 1) % 4];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * std::abs(twice);
}

// Tilt of a square from how much it is foreshortened, as if seen from far away.
double tilt(const std::array<Eigen::Vector2d, 4>& c) {
  Eigen::Matrix2d sides;
  sides << c[1] + c[2] - c[0] - c[3], c[2] + c[3] - c[0] - c[1];
  const Eigen::Vector2d stretch = sides.jacobiSvd().singularValues();
  return std::acos(std::clamp(stretch(1) / stretch(0), 0.0, 1.0));
}

// The marker and one side more around it.
cv::Rect place_of(const std::array<Eigen::Vector2d, 4>& corners, cv::Size image) {
  const Eigen::Vector2d px = centre(corners);
  const double half = 0.5 * k_patch_sides * std::sqrt(area(corners));
  return cv::Rect(cvRound(px.x() - half), cvRound(px.y() - half), cvCeil(2 * half), cvCeil(2 * half)) &
         cv::Rect({0, 0}, image);
}

// The place as k_patch_cells x k_patch_cells means.
cv::Mat patch_of(const cv::Mat& grey, const cv::Rect& place) {
  cv::Mat levels, patch;
  if (place.width < k_patch_cells || place.height < k_patch_cells) return patch;
  grey(place).convertTo(levels, CV_32F);
  cv::resize(levels, patch, {k_patch_cells, k_patch_cells}, 0, 0, cv::INTER_AREA);
  return patch;
}

// Whether nothing has moved by more than a tremor. A brightness step that moves by this much changes the mean
// of its cell by the same share of the cell.
bool is_still(const cv::Mat& now, const cv::Mat& before, double levels) {
  if (now.empty() || now.size() != before.size()) return false;
  cv::Mat change, brightest, darkest, allowed;
  cv::absdiff(now, before, change);
  cv::dilate(before, brightest, {});
  cv::erode(before, darkest, {});
  cv::magnitude((brightest - darkest) * (k_tremor * k_patch_cells / k_patch_sides),
                cv::Mat(now.size(), CV_32F, cv::Scalar(levels)), allowed);
  return cv::countNonZero(change > allowed) < k_few_cells;
}

}  // namespace

GestureReader::GestureReader(MarkerName marker, Gesture gesture, const GestureOptions& options)
    : marker_(std::move(marker)), gesture_(gesture), options_(options) {}

int GestureReader::read(const cv::Mat& grey, std::span<const Detection> detections, Stamp captured_at) {
  const auto found = std::find_if(detections.begin(), detections.end(),
                                  [&](const Detection& d) { return d.marker == marker_; });
  is_seen_ = found != detections.end();
  hidden_since_.reset();
  if (!is_seen_ && seen_at_ != Stamp{} && seconds_between(seen_at_, captured_at) > k_gap_s)
    hidden_since_ = seen_at_;
  note_neighbours(detections, captured_at);
  return is_seen_ ? update_visible(grey, *found, captured_at) : update_hidden(grey, captured_at);
}

int GestureReader::update_visible(const cv::Mat& grey, const Detection& detection, Stamp at) {
  if (seen_at_ == Stamp{} || seconds_between(seen_at_, at) > k_gap_s) seen_since_ = at;
  seen_at_ = at;
  corners_px_ = detection.corners_px;
  const cv::Rect place = place_of(corners_px_, grey.size());
  const cv::Mat patch = patch_of(grey, place);
  if (place == std::exchange(place_, place)) note_noise(patch);
  seen_patch_ = patch;
  still_patch_.release();
  if (seconds_between(seen_since_, at) >= k_armed_s) is_armed_ = true;
  if (gesture_ == Gesture::turn) return turned(detection, at);
  if (gesture_ == Gesture::lay) return laid(detection, at);
  return 0;
}

int GestureReader::update_hidden(const cv::Mat& grey, Stamp at) {
  if (gesture_ == Gesture::turn) return 0;
  if (!is_armed_ || is_tipped_) return 0;
  const cv::Mat patch = patch_of(grey, place_);
  const double still_s = still_for(patch, at);
  if (seconds_between(seen_at_, at) < options_.cover_s || still_s < options_.still_s) return 0;
  if (is_mostly_there(patch) || hides_across(at)) return 0;
  is_armed_ = false;
  is_tipped_ = gesture_ == Gesture::lay;  // whether it is tipped is decided when it is seen again
  return 1;
}

int GestureReader::turned(const Detection& detection, Stamp at) {
  const double now = direction(detection);
  if (!turn_rest_) turn_rest_ = now;
  if (std::abs(wrapped(now - turn_now_)) > k_rest_rad) {
    turn_now_ = now;
    turn_since_ = at;
  }
  const double step = options_.turn_deg * std::numbers::pi / 180;
  const double turn = wrapped(now - *turn_rest_);
  if (std::abs(turn) < step || seconds_between(turn_since_, at) < k_rest_s) return 0;
  turn_rest_ = now;
  return turn > 0 ? 1 : -1;  // y points down, so positive is clockwise as seen
}

int GestureReader::laid(const Detection& detection, Stamp at) {
  const double now = tilt(detection.corners_px);
  if (!is_armed_) return 0;
  if (!tilt_rest_) tilt_rest_ = now;
  const double tipped = std::abs(now - *tilt_rest_) / (options_.lay_deg * std::numbers::pi / 180);
  if (tipped < 0.5) is_tipped_ = false;
  if (tipped < 1 || is_tipped_) {
    tipped_since_ = at;
    return 0;
  }
  if (seconds_between(tipped_since_, at) < options_.still_s) return 0;
  is_tipped_ = true;
  return 1;
}

void GestureReader::note_neighbours(std::span<const Detection> detections, Stamp at) {
  for (const Detection& detection : detections) {
    if (detection.marker == marker_) continue;
    const Eigen::Vector2d px = centre(detection.corners_px);
    const auto known = std::find_if(neighbours_.begin(), neighbours_.end(),
                                    [&](const Neighbour& n) { return n.marker == detection.marker; });
    if (known == neighbours_.end())
      neighbours_.push_back({detection.marker, px, at});
    else
      *known = {detection.marker, px, at};
  }
  if (is_seen_)
    std::erase_if(neighbours_,
                  [&](const Neighbour& n) { return seconds_between(n.seen_at, at) > k_memory_s; });
}

// Whether markers on both sides of this one are hidden too, as by an arm across them.
bool GestureReader::hides_across(Stamp at) const {
  const double reach = k_neighbour_sides * std::sqrt(area(corners_px_));
  std::vector<Eigen::Vector2d> hidden;
  for (const Neighbour& n : neighbours_) {
    const Eigen::Vector2d d = n.px - centre(corners_px_);
    if (seconds_between(n.seen_at, at) > k_gap_s && d.norm() < reach) hidden.push_back(d.normalized());
  }
  return std::any_of(hidden.begin(), hidden.end(), [&](const Eigen::Vector2d& a) {
    return std::any_of(hidden.begin(), hidden.end(), [&](const Eigen::Vector2d& b) { return a.dot(b) < 0; });
  });
}

// How many seconds the marker's place has looked the same, compared with the mean of its images since then.
double GestureReader::still_for(const cv::Mat& patch, Stamp at) {
  const double levels = std::max(options_.still_levels, k_noise_deviations * noise_levels_);
  if (is_still(patch, still_patch_, levels)) {
    still_patch_ += (patch - still_patch_) / ++still_images_;
  } else {
    still_patch_ = patch.clone();
    still_images_ = 1;
    still_since_ = at;
  }
  return seconds_between(still_since_, at);
}

void GestureReader::note_noise(const cv::Mat& patch) {
  if (patch.empty() || patch.size() != seen_patch_.size()) return;
  cv::Mat1f change;
  cv::absdiff(patch, seen_patch_, change);
  const float middle = value_of_rank(&change, change.total() / 2);
  noise_levels_ += k_noise_blend * (k_deviations_per_median * middle - noise_levels_);
}

// Whether the marker itself is unchanged, except for an edge that a hand beside it hides.
bool GestureReader::is_mostly_there(const cv::Mat& patch) const {
  if (patch.empty() || patch.size() != seen_patch_.size()) return false;
  const int side = cvFloor(k_patch_cells / k_patch_sides), first = (k_patch_cells - side) / 2;
  const cv::Rect marker(first, first, side, side);
  cv::Mat change;
  cv::absdiff(patch(marker), seen_patch_(marker), change);
  double darkest = 0, brightest = 0;
  cv::minMaxLoc(seen_patch_(marker), &darkest, &brightest);
  return cv::countNonZero(change <= k_alike * (brightest - darkest)) > k_mostly * side * side;
}

}  // namespace limn::tracker
