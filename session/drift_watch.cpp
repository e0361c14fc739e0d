#include "session/drift_watch.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "session/stillness.h"
#include "tracker/marker_light.h"

namespace limn::session {
namespace {

constexpr double k_cells_a_second = 60;  // cells that are compared per second
constexpr double k_look_s = 0.3;         // between the starts of two comparisons
constexpr double k_rests_s = 0.5;        // how long a prototype must rest before it is compared
constexpr double k_before_s = 0.25;      // light that has changed within this time is not compared
constexpr double k_holds_s = 3;          // how long a finding must hold before drift_ changes
constexpr double k_paper = 1.8;          // side of the area that is left out around a marker, in marker sides
constexpr double k_least_px = 1.5;       // smaller displacements do not matter
constexpr double k_least_contrast = 0.3;
constexpr double k_least_correlation = 0.3;
// Share of what the calibrated poses do not explain that the motion of a device must explain.
constexpr double k_least_gain = 0.1;
constexpr double k_as_good = 0.92;  // devices with this share of the best gain explain it equally well

// Where a camera's image shows the paper of markers: of those that it detected, and of those that are too
// small, too dark or too blurred for that, but are on a tracked body.
cv::Mat papers(const Imager& camera,
               const std::vector<tracker::Detection>& detections,
               std::span<const Body> bodies,
               std::span<const Constellation> constellations,
               std::span<const Track> tracks) {
  const tracker::MarkerLightOptions paper{.margin = (k_paper - 1) / 2};
  cv::Mat mask = tracker::marker_mask(camera, bodies, tracks, paper);
  if (!constellations.empty()) mask |= tracker::ball_mask(camera, constellations, tracks, paper);
  for (const tracker::Detection& detection : detections) {
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const auto& corner : detection.corners_px) middle += 0.25 * corner;
    std::vector<cv::Point> corners;
    for (const auto& corner : detection.corners_px) {
      const Eigen::Vector2d p = middle + k_paper * (corner - middle);
      corners.emplace_back(cvRound(p.x()), cvRound(p.y()));
    }
    cv::fillConvexPoly(mask, corners, cv::Scalar(255));
  }
  return mask;
}

}  // namespace

std::string sentence(const Drift& drift) {
  std::string names;
  for (const std::string& name : drift.devices) names += (names.empty() ? "" : " or ") + name;
  return fmt::format(
      "{} has moved since the calibration: the projected light is off by {:.1f} px ({:.1f} mm). Put it back, "
      "or start a repair: it shows patterns on the prototype for about 15 s, then the session continues "
      "with a corrected rig. (With only one camera and one projector, end the session instead and run limn "
      "recheck with the board.)",
      names, drift.px, drift.mm);
}

std::optional<std::string> DriftNotices::new_notice(const std::optional<Drift>& drift) {
  const bool is_new =
      drift.has_value() != reported_.has_value() || (drift && drift->devices != reported_->devices);
  if (!is_new) return std::nullopt;
  reported_ = drift;
  return drift ? sentence(*drift) : "All devices are back in their calibrated position.";
}

DriftWatch::DriftWatch(const Rig& rig) : rig_(rig) {
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) lights_.emplace_back(rig, i);
}

void DriftWatch::compare(const Percepts& percepts,
                         const scene::PosedScene& posed,
                         std::span<const Body> bodies,
                         std::span<const Constellation> constellations,
                         std::span<const Track> tracks,
                         const ProjectionHistory& shown,
                         projector::Renderer* renderer) {
  if (!posed.world_from_prototype || lights_.empty()) return;
  const Stamp at = percepts.captured_at;
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
  if (light.is_comparing()) {
    const double passed_s = std::clamp(seconds_between(compared_at_, at), 0.0, k_look_s);
    compared_at_ = at;
    if (light.compare(1 + static_cast<int>(k_cells_a_second * passed_s))) settle(judged(), at);
    return;
  }
  if (seconds_between(began_at_, at) < k_look_s) return;
  began_at_ = compared_at_ = at;
  turn_ = (turn_ + 1) % lights_.size();
  const Frame& frame = percepts.frames[turn_];
  if (frame.image.empty() || rig_.cameras[turn_].sees != Spectrum::visible) return;
  const auto* now = shown.at(frame.captured_at);
  const auto* before = shown.at(shifted(frame.captured_at, -k_before_s));
  if (!now || !before) return;
  lights_[turn_].begin(
      frame, *now, *before,
      papers(rig_.cameras[turn_], percepts.detections[turn_], bodies, constellations, tracks));
}

// Finds the device whose motion explains best what all cameras see; nullopt if no motion explains it better
// than the calibrated poses.
std::optional<Drift> DriftWatch::judged() const {
  struct Candidate {
    std::string device;
    double gain = 0, contrast = 0, correlation = 0, unshifted_correlation = 0, px = 0, mm = 0;

    void add(const projector::Displacement& moved, double mm_per_px) {
      gain += moved.gain;
      contrast += moved.contrast;
      correlation += moved.contrast * moved.correlation;
      unshifted_correlation += moved.contrast * moved.unshifted_correlation;
      if (moved.px.norm() <= px) return;
      px = moved.px.norm();
      mm = mm_per_px * px;
    }
  };
  std::vector<Candidate> candidates;
  for (const Imager& projector : rig_.projectors) candidates.push_back({projector.name});
  for (std::size_t i = 0; i < lights_.size(); ++i) {
    const projector::LightDisplacements places = lights_[i].displacements();
    if (rig_.cameras[i].sees != Spectrum::visible) continue;  // it sees no projected light
    for (std::size_t k = 0; k < places.projectors.size(); ++k)
      candidates[k].add(places.projectors[k], places.mm_per_px);
    candidates.push_back({rig_.cameras[i].name});
    candidates.back().add(places.all, places.mm_per_px);
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.gain > b.gain; });
  const Candidate& best = candidates.front();
  if (best.contrast < k_least_contrast || best.correlation < k_least_correlation * best.contrast ||
      best.correlation - best.unshifted_correlation <
          k_least_gain * (best.contrast - best.unshifted_correlation) ||
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

}  // namespace limn::session
