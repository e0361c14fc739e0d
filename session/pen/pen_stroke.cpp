#include "session/pen/pen_stroke.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace limn::session {
namespace {

constexpr double k_reach_m = 0.02;   // the surface is searched for so far
constexpr double k_thin_m = 2e-3;    // shells up to this thickness are thin
constexpr double k_window_s = 0.13;  // samples within it are smoothed together: four on each side at 30 Hz
constexpr double k_delay_s = 0.045;  // a point waits for samples after it
constexpr double k_most_shift_m = 0.4e-3;  // smoothing moves a point so far: corners stay
constexpr double k_step_m = 0.5e-3;        // between points, so that a hand that rests adds none
constexpr double k_touch_m = 2e-3;         // a shorter stroke is none
constexpr double k_fastest_m_s = 2;        // faster than a hand draws: the pose is wrong
constexpr std::size_t k_most_waiting = 100;

const Track* find_track(std::span<const Track> tracks, const std::string& body) {
  const auto found = std::ranges::find(tracks, body, &Track::body);
  return found == tracks.end() ? nullptr : &*found;
}

// The nearest place, on the pen's side if the prototype is a thin shell there.
std::optional<scene::SurfacePoint> nearest(const scene::Drape& drape,
                                           const Eigen::Vector3d& p,
                                           const Eigen::Vector3d& d_side) {
  const auto any = drape.nearest(p, k_reach_m);
  if (!any) return std::nullopt;
  const auto on_side = drape.nearest(p, (any->p - p).norm() + k_thin_m, d_side);
  return on_side ? on_side : any;
}

// Where the pen is as seen from the surface: towards its marker's middle and its front, because the marker
// stands on the surface, lies on it, or is above it.
Eigen::Vector3d side_of(const Pose& prototype_from_pen, const Eigen::Vector3d& p_tip_marker) {
  const Eigen::Vector3d in_marker = -p_tip_marker.stableNormalized() - Eigen::Vector3d::UnitZ();
  return in_marker.norm() < 0.1 ? Eigen::Vector3d::Zero().eval()
                                : (prototype_from_pen.rotation * in_marker.normalized()).eval();
}

}  // namespace

PenStroke::Addition PenStroke::note(const scene::Scene& scene, std::span<const Track> tracks, Stamp now) {
  if (!scene.pen || !scene.drape) return {};
  const scene::Drape& drape = *scene.drape;
  const Track *pen = find_track(tracks, scene::pen_body()), *prototype = find_track(tracks, "prototype");
  const bool is_measured = pen && pen->tracking == TrackingState::measured && prototype &&
                           prototype->tracking != TrackingState::lost;
  if (!is_measured || pen->captured_at == seen_at_) {
    if (is_on_ && seen_at_ && seconds_between(*seen_at_, now) > k_gone_s) end(drape);
    return taken();
  }
  const Pose prototype_from_pen = prototype->world_from_body.inverse() * pen->world_from_body;
  const Sample sample{pen->captured_at, prototype_from_pen * scene.pen->p_tip_marker,
                      side_of(prototype_from_pen, scene.pen->p_tip_marker)};
  const double waited_s = seen_at_ ? seconds_between(*seen_at_, sample.at) : 0;
  const bool is_jump =
      is_on_ && (sample.p - samples_.back().p).norm() > k_fastest_m_s * std::abs(waited_s) + 2e-3;
  if (is_on_ && (waited_s > k_gone_s || waited_s < 0 || is_jump)) end(drape);
  Addition addition = taken();  // a former stroke ends in a moment of its own
  seen_at_ = sample.at;
  if (!addition.points.empty()) return addition;
  add(drape, sample);
  return taken();
}

void PenStroke::add(const scene::Drape& drape, const Sample& sample) {
  const auto below = nearest(drape, sample.p, sample.d_side);
  const double height = below ? (below->p - sample.p).norm() : k_reach_m;
  if (height > (is_on_ ? k_ends_m : k_begins_m)) {
    if (is_on_) end(drape);
    return;
  }
  if (!is_on_) {
    is_on_ = true;
    has_begun_ = is_long_ = false;
    samples_.clear();
    next_ = 0;
    p_last_.reset();
  }
  samples_.push_back(sample);
  smooth_until(drape, shifted(sample.at, -k_delay_s));
}

// Adds the points of samples until `last`.
void PenStroke::smooth_until(const scene::Drape& drape, Stamp last) {
  for (; next_ < samples_.size() && samples_[next_].at <= last; ++next_) {
    const auto point = nearest(drape, smoothed(next_), samples_[next_].d_side);
    if (!point || (p_last_ && (point->p - *p_last_).norm() < k_step_m)) continue;
    if (!p_last_) p_first_ = point->p;
    p_last_ = point->p;
    is_long_ = is_long_ || (point->p - p_first_).norm() > k_touch_m;
    waiting_.push_back(point->p);
  }
  while (next_ > 0 && seconds_between(samples_.front().at,
                                      samples_[std::min(next_, samples_.size() - 1)].at) > k_window_s) {
    samples_.pop_front();
    --next_;
  }
}

// A local regression (quadratic in time, tricube weights) at the time of a sample: it moves neither a
// straight stroke nor a bend as a mean would.
Eigen::Vector3d PenStroke::smoothed(std::size_t index) const {
  const Sample& at = samples_[index];
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d right = Eigen::Matrix3d::Zero();
  int count = 0;
  for (const Sample& sample : samples_) {
    const double t = seconds_between(at.at, sample.at) / k_window_s;
    if (std::abs(t) >= 1) continue;
    const double cube = 1 - std::pow(std::abs(t), 3), weight = cube * cube * cube;
    const Eigen::Vector3d powers(1, t, t * t);
    normal += weight * powers * powers.transpose();
    right += weight * powers * (sample.p - at.p).transpose();
    ++count;
  }
  constexpr int k_least = 4;  // fewer samples fix a quadratic without smoothing
  if (count < k_least) return at.p;
  const Eigen::Vector3d shift = normal.ldlt().solve(right).row(0).transpose();
  if (!shift.allFinite()) return at.p;
  return at.p + shift * std::min(1.0, k_most_shift_m / std::max(shift.norm(), 1e-9));
}

void PenStroke::end(const scene::Drape& drape) {
  if (!samples_.empty()) smooth_until(drape, samples_.back().at);
  if (!is_long_) waiting_.clear();
  is_on_ = false;
}

PenStroke::Addition PenStroke::taken() {
  if (waiting_.empty() || (!is_long_ && waiting_.size() < k_most_waiting)) return {};
  Addition addition{.begins = !has_begun_, .points = std::move(waiting_)};
  waiting_.clear();
  has_begun_ = true;
  return addition;
}

}  // namespace limn::session
