#include "session/perception.h"

#include <algorithm>
#include <chrono>
#include <numbers>
#include <utility>

#include "core/names.h"
#include "core/stopwatch.h"
#include "tracker/body_correspondences.h"
#include "tracker/camera_encoding.h"
#include "tracker/family.h"
#include "tracker/predict.h"

namespace limn::session {
namespace {

// A loose marker is tracked after it was seen in this many moments, and forgotten when unseen for this long.
constexpr int k_known_after = 5;
constexpr double k_forgotten_s = 2;
constexpr double k_still_m = 0.005, k_still_rad = 5 * std::numbers::pi / 180;
constexpr double k_lying_m = 0.01, k_lying_rad = 45 * std::numbers::pi / 180;

// The families of all bodies and controls.
std::vector<std::string> families_of(const scene::Scene& scene, std::vector<Body> bodies) {
  for (const scene::Control& control : scene.controls)
    bodies.push_back({"(control)", {{control.marker, 0, Pose{}}}});
  return tracker::families_of(bodies);
}

}  // namespace

Result<tracker::CameraDetectorSetup> camera_detector_setup(const scene::Scene& scene, int full_scan_every) {
  LIMN_CHECK(full_scan_every > 0);
  const std::vector<Body> bodies = scene::bodies(scene);
  LIMN_TRY(tracker::Families families, tracker::Families::load(families_of(scene, bodies), scene.folder));
  tracker::CameraDetectorSetup out{.families = std::move(families),
                                   .finds_balls = !scene::constellations(scene).empty(),
                                   .full_scan_every = full_scan_every};
  for (const Body& body : bodies)
    for (const BodyMarker& marker : body.markers) out.used.push_back(marker.marker);
  for (const scene::Control& control : scene.controls) {
    out.used.push_back(control.marker);
    out.controls.emplace_back(control.marker, control.gesture);
  }
  return out;
}

Result<Perception> Perception::create(const scene::Scene& scene,
                                      const Rig& rig,
                                      const PerceptionOptions& options) {
  LIMN_TRY(const tracker::CameraDetectorSetup watched, camera_detector_setup(scene, options.full_scan_every));
  Perception out;
  out.used_ = watched.used;
  out.rig_ = rig;
  out.options_ = options;
  out.bodies_ = scene::bodies(scene);
  out.constellations_ = scene::constellations(scene);
  out.loose_size_m_ = scene::first_marker_size_m(scene);
  for (const Imager& camera : rig.cameras)
    out.detectors_.emplace_back(watched, camera.lens, tracker::encoding_of(rig, camera));
  out.uses_.emplace(rig.cameras.size(), scene.controls.size());
  out.percepts_.frames.resize(rig.cameras.size());
  out.percepts_.detections.resize(rig.cameras.size());
  for (const tracker::FeedSetup& feed : options.feeds) out.feeds_.emplace_back(feed);
  out.percepts_.screen_camera = rig.first_visible_camera();
  if (!out.constellations_.empty()) out.percepts_.balls.resize(rig.cameras.size());
  return out;
}

Result<Perception> Perception::successor(const scene::Scene& scene, const Rig& rig) const {
  LIMN_TRY(Perception next, create(scene, rig, options_));
  next.feeds_ = feeds_;
  return next;
}

const Percepts& Perception::watch(std::span<const Frame> frames, const FeedInput& input) {
  const auto begun = std::chrono::steady_clock::now();
  percepts_.uses.clear();
  percepts_.feed_notes = input.notes;
  std::vector<std::size_t> cameras;
  std::vector<const tracker::CameraDetections*> found;
  for (const Frame& frame : frames) {
    cameras.push_back(number_of(frame.camera));
    percepts_.frames[cameras.back()] = frame;
    found.push_back(&detect(cameras.back(), frame));
    note_found(cameras.back(), *found.back());
  }
  for (const tracker::CameraDetections& sent : input.detections) {
    cameras.push_back(number_of(sent.camera));
    found.push_back(&sent);
    note_found(cameras.back(), sent);
  }
  for (const Frame& image : input.images) percepts_.frames[number_of(image.camera)] = image;
  for (std::size_t i = 0; i < cameras.size(); ++i)
    std::ranges::copy(uses_->read(cameras[i], *found[i]), std::back_inserter(percepts_.uses));
  percepts_.detect_ms = milliseconds_since(begun);

  note_loose(cameras);
  const auto filtering = std::chrono::steady_clock::now();
  filter(cameras, input);
  percepts_.filter_ms = milliseconds_since(filtering);
  return percepts_;
}

// Bodies with markers and bodies with balls are filtered alike.
void Perception::filter(std::span<const std::size_t> cameras, const FeedInput& input) {
  if (cameras.empty() && input.is_empty()) return;
  if (!cameras.empty()) filter_seen(cameras);
  percepts_.motions = seen_;
  if (!feeds_.empty()) follow_feeds(!cameras.empty(), input);
  percepts_.tracks = tracker::predicted(percepts_.motions, percepts_.captured_at,
                                        tracker::Prediction::filtered, options_.motion);
  follow_loose();
}

void Perception::filter_seen(std::span<const std::size_t> cameras) {
  std::vector<tracker::View> views;
  std::vector<tracker::BallView> ball_views;
  for (const std::size_t i : cameras) {
    views.push_back({&rig_.cameras[i], percepts_.detections[i]});
    if (!constellations_.empty()) ball_views.push_back({&rig_.cameras[i], percepts_.balls[i]});
  }
  std::vector<Body> bodies = bodies_;
  for (const Loose& loose : loose_)
    if (loose.moments >= k_known_after)
      bodies.push_back({scene::loose_body(loose.marker), {{loose.marker, loose_size_m_, Pose()}}});
  const Stamp at = percepts_.captured_at;
  auto motions = tracker::observed(seen_, bodies, views, at, options_.motion);
  std::ranges::move(
      tracker::observed(seen_, constellations_, ball_views, at, options_.motion, options_.triple_pose),
      std::back_inserter(motions));
  seen_ = std::move(motions);
}

// Combines the cameras' motions with those that other tracking systems state. Their own stays without them,
// so that a system is registered by what the cameras alone have seen.
void Perception::follow_feeds(bool has_frames, const FeedInput& input) {
  Stamp at = percepts_.captured_at;
  for (const auto& of_feed : input.poses)
    for (const tracker::ArrivedPose& pose : of_feed) at = std::max(at, pose.arrived_at);
  if (!has_frames) percepts_.captured_at = at;
  percepts_.feeds.clear();
  for (std::size_t i = 0; i < feeds_.size(); ++i) {
    tracker::ForeignTracker& feed = feeds_[i];
    if (i < input.poses.size()) feed.receive(input.poses[i]);
    for (const tracker::BodyFilter& seen : seen_)
      if (has_frames && seen.measured_at == percepts_.captured_at && seen.images_to_confirm == 0 &&
          !seen.fixes.empty())
        feed.add_own(seen.body, seen.fixes.back());
    feed.update();
    for (tracker::BodyFilter& motion : feed.motions(at)) {
      const auto known = std::ranges::find(percepts_.motions, motion.body, &tracker::BodyFilter::body);
      if (known == percepts_.motions.end())
        percepts_.motions.push_back(std::move(motion));
      else
        *known = tracker::combined(&*known, motion, options_.motion);
    }
    for (tracker::FeedStatus& status : feed.statuses(at)) percepts_.feeds.push_back(std::move(status));
    for (std::string& note : feed.take_notes(at)) percepts_.feed_notes.push_back(std::move(note));
  }
}

std::size_t Perception::number_of(const std::string& name) const {
  const Imager* camera = find_named(rig_.cameras, name);
  LIMN_CHECK(camera != nullptr);
  return static_cast<std::size_t>(camera - rig_.cameras.data());
}

const tracker::CameraDetections& Perception::detect(std::size_t camera, const Frame& frame) {
  return detectors_[camera].detect(frame, [&](const MarkerName& used) {
    for (std::size_t i = 0; i < detectors_.size(); ++i)
      for (const tracker::Detection& detection : percepts_.detections[i])
        if (i != camera && tracker::is_marker(detection.marker, used)) return true;
    return false;
  });
}

void Perception::note_found(std::size_t camera, const tracker::CameraDetections& found) {
  percepts_.detections[camera] = found.detections;
  if (!constellations_.empty()) percepts_.balls[camera] = found.balls;
  percepts_.captured_at = std::max(percepts_.captured_at, found.captured_at);
}

// Notes seen markers that the scene does not use (of the scene's families).
void Perception::note_loose(std::span<const std::size_t> cameras) {
  const Stamp at = percepts_.captured_at;
  std::vector<MarkerName> seen;
  for (const std::size_t camera : cameras)
    for (const tracker::Detection& detection : percepts_.detections[camera])
      if (std::none_of(used_.begin(), used_.end(),
                       [&](const MarkerName& used) { return tracker::is_marker(detection.marker, used); }))
        seen.push_back(detection.marker);
  std::sort(seen.begin(), seen.end());
  seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
  std::erase_if(loose_,
                [&](const Loose& loose) { return seconds_between(loose.seen_at, at) > k_forgotten_s; });
  for (const MarkerName& marker : seen) {
    auto known = std::find_if(loose_.begin(), loose_.end(),
                              [&](const Loose& loose) { return loose.marker == marker; });
    if (known == loose_.end()) {
      if (loose_size_m_ <= 0 || static_cast<int>(loose_.size()) >= options_.most_loose) continue;
      loose_.push_back({marker, 0, at, std::nullopt, at});
      known = std::prev(loose_.end());
    }
    ++known->moments;
    known->seen_at = at;
  }
}

// Updates the poses of loose markers, and since when each is still.
void Perception::follow_loose() {
  percepts_.loose.clear();
  if (loose_.empty()) return;
  for (const Track& track : percepts_.tracks) {
    const auto loose = std::find_if(loose_.begin(), loose_.end(), [&](const Loose& l) {
      return scene::loose_body(l.marker) == track.body;
    });
    if (loose == loose_.end() || track.tracking == TrackingState::lost) continue;
    const Pose& now = track.world_from_body;
    const bool lies = seconds_between(loose->still_since, percepts_.captured_at) >= k_lies_after_s;
    if (!loose->anchor ||
        (now.translation - loose->anchor->translation).norm() > (lies ? k_lying_m : k_still_m) ||
        angle_between(now.rotation, loose->anchor->rotation) > (lies ? k_lying_rad : k_still_rad)) {
      loose->anchor = now;
      loose->still_since = percepts_.captured_at;
    }
    percepts_.loose.push_back({loose->marker, now, loose->still_since});
  }
  std::stable_sort(percepts_.loose.begin(), percepts_.loose.end(),
                   [](const LooseMarker& a, const LooseMarker& b) { return a.still_since < b.still_since; });
}

}  // namespace limn::session
