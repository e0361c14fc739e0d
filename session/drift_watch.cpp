#include "session/drift_watch.h"

#include <algorithm>
#include <cmath>

#include "session/stillness.h"

namespace limn::apps {
namespace {

constexpr double k_cells_a_second = 60;  // that are compared
constexpr double k_look_s = 0.3;         // between the beginnings of two looks
constexpr double k_rests_s = 0.5;        // before a prototype that was moved is looked at
constexpr double k_before_s = 0.25;      // light that differs from that so long ago is not looked at
constexpr double k_holds_s = 3;          // before something is said, or taken back
constexpr double k_paper = 1.8;          // side of what is left out around a marker, in its sides
constexpr double k_least_px = 1.5;       // of a displacement that matters
constexpr double k_least_contrast = 0.3;
constexpr double k_least_likeness = 0.3;
constexpr double k_least_gain = 0.1;  // of what is not explained by all in its place, that a move explains
constexpr double k_as_good = 0.92;    // of the best gain: as good an explanation

// Markers with their paper.
std::vector<std::vector<cv::Point>> papers(const std::vector<tracker::Detection>& detections) {
  std::vector<std::vector<cv::Point>> out;
  for (const tracker::Detection& detection : detections) {
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const auto& corner : detection.corners_px) middle += 0.25 * corner;
    std::vector<cv::Point> corners;
    for (const auto& corner : detection.corners_px) {
      const Eigen::Vector2d p = middle + k_paper * (corner - middle);
      corners.emplace_back(cvRound(p.x()), cvRound(p.y()));
    }
    out.push_back(std::move(corners));
  }
  return out;
}

}  // namespace

std::string sentence(const Drift& drift) {
  std::string names;
  for (const std::string& name : drift.devices) names += (names.empty() ? "" : " or ") + name;
  return fmt::format(
      "{} has moved since the calibration: light lies {:.1f} px ({:.1f} mm) beside its place. Put it back, "
      "or ask for repair: 15 s of patterns on the prototype as it stands, and the session goes on with a "
      "mended "
      "rig (with one camera and one projector end it, and let limn recheck look at the board).",
      names, drift.px, drift.mm);
}

std::optional<std::string> DriftNotices::news(const std::optional<Drift>& drift) {
  const bool is_news = drift.has_value() != told_.has_value() || (drift && drift->devices != told_->devices);
  if (!is_news) return std::nullopt;
  told_ = drift;
  return drift ? sentence(*drift) : "all light is where the rig says again";
}

DriftWatch::DriftWatch(const Rig& rig) : rig_(rig) {
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) lights_.emplace_back(rig, i);
}

void DriftWatch::look(const Percepts& watched,
                      const scene::PosedScene& posed,
                      const ProjectionHistory& shown,
                      projector::Renderer* renderer) {
  if (!posed.world_from_prototype || lights_.empty()) return;
  const Stamp at = watched.captured_at;
  if (!rests_ || is_elsewhere(*rests_, *posed.world_from_prototype)) {
    rests_ = posed.world_from_prototype;
    rests_since_ = at;
  }
  if (seconds_between(rests_since_, at) < k_rests_s) return;
  if (!placed_ || is_elsewhere(*placed_, *rests_)) {
    placed_ = rests_;
    for (std::size_t i = 0; i < lights_.size(); ++i)
      lights_[i].place(renderer->illuminated_patches(i, posed, lights_[i].side_px()));
  }
  projector::MisalignmentDetector& light = lights_[turn_];
  if (light.is_looking()) {
    const double passed_s = std::clamp(seconds_between(compared_at_, at), 0.0, k_look_s);
    compared_at_ = at;
    if (light.compare(1 + static_cast<int>(k_cells_a_second * passed_s))) settle(judged(), at);
    return;
  }
  if (seconds_between(began_at_, at) < k_look_s) return;
  began_at_ = compared_at_ = at;
  turn_ = (turn_ + 1) % lights_.size();
  const Frame& frame = watched.frames[turn_];
  if (frame.image.empty()) return;
  const auto* now = shown.at(frame.captured_at);
  const auto* before = shown.at(shifted(frame.captured_at, -k_before_s));
  if (!now || !before) return;
  lights_[turn_].begin(frame, *now, *before, papers(watched.detections[turn_]));
}

// The device that, moved, explains best what all cameras see; none where none is better than all in its
// place.
std::optional<Drift> DriftWatch::judged() const {
  struct Candidate {
    std::string device;
    double gain = 0, contrast = 0, likeness = 0, as_foretold = 0, px = 0, mm = 0;

    void add(const projector::Displacement& moved, double mm_per_px) {
      gain += moved.gain;
      contrast += moved.contrast;
      likeness += moved.contrast * moved.likeness;
      as_foretold += moved.contrast * moved.as_foretold;
      if (moved.px.norm() <= px) return;
      px = moved.px.norm();
      mm = mm_per_px * px;
    }
  };
  std::vector<Candidate> candidates;
  for (const Imager& projector : rig_.projectors) candidates.push_back({projector.name});
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    const projector::LightDisplacements places = lights_[i].places();
    for (std::size_t k = 0; k < places.projectors.size(); ++k)
      candidates[k].add(places.projectors[k], places.mm_per_px);
    candidates.push_back({rig_.cameras[i].name});
    candidates.back().add(places.all, places.mm_per_px);
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.gain > b.gain; });
  const Candidate& best = candidates.front();
  if (best.contrast < k_least_contrast || best.likeness < k_least_likeness * best.contrast ||
      best.likeness - best.as_foretold < k_least_gain * (best.contrast - best.as_foretold) ||
      best.px < k_least_px)
    return std::nullopt;
  Drift drift{{}, best.px, best.mm};
  for (const Candidate& candidate : candidates)
    if (candidate.gain >= k_as_good * best.gain) drift.devices.push_back(candidate.device);
  std::sort(drift.devices.begin(), drift.devices.end());
  return drift;
}

void DriftWatch::settle(std::optional<Drift> found, Stamp at) {
  const bool is_same =
      found.has_value() == drift_.has_value() && (!found || found->devices == drift_->devices);
  if (is_same) {
    differs_since_.reset();
    if (found) drift_ = found;
    return;
  }
  if (!differs_since_) differs_since_ = at;
  if (seconds_between(*differs_since_, at) < k_holds_s) return;
  drift_ = std::move(found);
  differs_since_.reset();
}

}  // namespace limn::apps
