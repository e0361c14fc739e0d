#include "session/perception.h"

#include <algorithm>
#include <chrono>
#include <numbers>

#include "core/image_io.h"
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
constexpr double k_once_s = 0.4;  // gestures of two cameras within this time are one use
// While all of the scene's markers are seen, full searches are k_rarer times rarer. Only every
// k_covered_every-th search also looks for partly covered markers.
constexpr int k_rarer = 3;
constexpr int k_covered_every = 2;
// If the time between images grows by more than this factor, markers are not extrapolated.
constexpr double k_like_moments = 3;

// Whether a marker has moved by more than its corners' noise.
bool has_moved(const tracker::Detection& now, const tracker::Detection& before) {
  constexpr double k_deviations = 3;
  for (std::size_t i = 0; i < 4; ++i) {
    const double variance = (now.corner_covariance[i] + before.corner_covariance[i]).trace();
    if ((now.corners_px[i] - before.corners_px[i]).squaredNorm() > k_deviations * k_deviations * variance)
      return true;
  }
  return false;
}

// Predicts markers `seconds` ahead, with the image motion that they had in the `seconds_before`.
std::vector<tracker::Detection> predicted_detections(const std::vector<tracker::Detection>& last,
                                                     const std::vector<tracker::Detection>& before,
                                                     double seconds,
                                                     double seconds_before) {
  std::vector<tracker::Detection> next = last;
  if (!(seconds_before > 0 && seconds > 0 && seconds < k_like_moments * seconds_before)) return next;
  for (tracker::Detection& marker : next) {
    const tracker::Detection* was = nullptr;  // the nearest earlier one with that name
    const auto moved = [&](const tracker::Detection& other) {
      return (marker.corners_px[0] - other.corners_px[0]).norm();
    };
    for (const tracker::Detection& other : before)
      if (other.marker == marker.marker && (!was || moved(other) < moved(*was))) was = &other;
    if (!was || !has_moved(marker, *was)) continue;
    for (std::size_t i = 0; i < 4; ++i)
      marker.corners_px[i] += seconds / seconds_before * (marker.corners_px[i] - was->corners_px[i]);
  }
  return next;
}

// The families of all bodies and controls.
std::vector<std::string> families_of(const scene::Scene& scene, std::vector<Body> bodies) {
  for (const scene::Control& control : scene.controls)
    bodies.push_back({"(control)", {{control.marker, 0, Pose{}}}});
  return tracker::families_of(bodies);
}

}  // namespace

Result<Perception> Perception::create(const scene::Scene& scene,
                                      const Rig& rig,
                                      const PerceptionOptions& options) {
  LIMN_CHECK(options.full_scan_every > 0);
  Perception out;
  out.rig_ = rig;
  out.options_ = options;
  out.bodies_ = scene::bodies(scene);
  out.constellations_ = scene::constellations(scene);
  out.loose_size_m_ = scene::first_marker_size_m(scene);
  for (const Body& body : out.bodies_)
    for (const BodyMarker& marker : body.markers) out.used_.push_back(marker.marker);
  for (const scene::Control& control : scene.controls) out.used_.push_back(control.marker);
  LIMN_TRY(const tracker::Families families,
           tracker::Families::load(families_of(scene, out.bodies_), scene.folder));
  std::vector<tracker::GestureReader> gestures;
  for (const scene::Control& control : scene.controls) {
    gestures.emplace_back(control.marker, control.gesture);
  }
  for (const Imager& camera : rig.cameras) {
    const tracker::Encoding encoding = tracker::encoding_of(rig, camera);
    out.camera_states_.push_back({.detector = tracker::Detector(families, {.encoding = encoding}),
                                  .gestures = gestures,
                                  .ball_finder = tracker::BallFinder({.encoding = encoding})});
  }
  out.used_at_.resize(scene.controls.size());
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
  for (const Frame& frame : frames) {
    const Imager* camera = find_named(rig_.cameras, frame.camera);
    LIMN_CHECK(camera != nullptr);
    cameras.push_back(static_cast<std::size_t>(camera - rig_.cameras.data()));
    update_camera(cameras.back(), frame);
    percepts_.captured_at = std::max(percepts_.captured_at, frame.captured_at);
  }
  read_gestures(cameras);
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

void Perception::update_camera(std::size_t camera, const Frame& frame) {
  CameraState& state = camera_states_[camera];
  percepts_.frames[camera] = frame;
  state.grey = frame.grey.empty() ? to_grey(frame.image) : frame.grey;
  if (!constellations_.empty())
    percepts_.balls[camera] = state.ball_finder.find(state.grey, rig_.cameras[camera].lens);
  if (!used_.empty()) find_markers(camera, frame.captured_at);
}

// Follows known markers near their predicted positions. Searches the whole image for others from time to
// time, and when a marker is gone.
void Perception::find_markers(std::size_t camera, Stamp captured_at) {
  CameraState& state = camera_states_[camera];
  const Lens* lens = &rig_.cameras[camera].lens;
  std::vector<tracker::Detection>& detections = percepts_.detections[camera];
  const double seconds = seconds_between(state.seen_at, captured_at);
  const std::vector<tracker::Detection> next =
      predicted_detections(detections, state.before, seconds, std::exchange(state.seconds, seconds));
  state.seen_at = captured_at;
  std::swap(state.before, detections);
  state.detector.follow(state.grey, lens, next, &detections);
  const bool is_one_gone = detections.size() < next.size();
  if (--state.until_search > 0 && !is_one_gone) return;
  const bool covered = state.searches++ % k_covered_every == 0 || !all_are_seen();
  state.detector.detect_more(state.grey, lens, &detections,
                             covered ? tracker::Reading::covered : tracker::Reading::open);
  state.until_search = (all_are_seen() ? k_rarer : 1) * options_.full_scan_every;
}

// Whether each marker that bodies and controls use is seen by some camera.
bool Perception::all_are_seen() const {
  return std::all_of(used_.begin(), used_.end(), [&](const MarkerName& used) {
    return std::any_of(percepts_.detections.begin(), percepts_.detections.end(), [&](const auto& of_camera) {
      return std::any_of(of_camera.begin(), of_camera.end(), [&](const tracker::Detection& detection) {
        return tracker::is_marker(detection.marker, used);
      });
    });
  });
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

// A control is used when one camera sees the gesture and no other camera sees the marker uncovered. If
// several controls are hidden together, only the one hidden last counts: the arm hides the others on the
// hand's way.
void Perception::read_gestures(std::span<const std::size_t> cameras) {
  for (const std::size_t camera : cameras) {
    std::vector<tracker::GestureReader>& gestures = camera_states_[camera].gestures;
    const Stamp at = percepts_.frames[camera].captured_at;
    std::vector<int> steps;
    for (tracker::GestureReader& gesture : gestures)
      steps.push_back(gesture.read(camera_states_[camera].grey, percepts_.detections[camera], at));
    for (std::size_t i = 0; i < gestures.size(); ++i) {
      if (steps[i] == 0) continue;
      const bool is_seen_elsewhere =
          !gestures[i].is_seen() &&
          std::any_of(camera_states_.begin(), camera_states_.end(), [&](const CameraState& other) {
            return &other.gestures != &gestures && other.gestures[i].is_seen();
          });
      const bool is_arms = std::any_of(gestures.begin(), gestures.end(), [&](const auto& other) {
        return gestures[i].hidden_since() && other.hidden_since() > gestures[i].hidden_since();
      });
      const bool is_known = used_at_[i] != Stamp{} && seconds_between(used_at_[i], at) < k_once_s;
      if (is_seen_elsewhere || is_arms || is_known) continue;
      used_at_[i] = at;
      percepts_.uses.push_back({i, steps[i]});
    }
  }
}

}  // namespace limn::session
