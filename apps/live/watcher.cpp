#include "apps/live/watcher.h"

#include <algorithm>
#include <chrono>
#include <map>

#include "apps/camera_encoding.h"
#include "core/picture.h"
#include "tracker/family.h"

namespace limn::apps {
namespace {

constexpr double k_once_s = 0.4;  // two cameras that see one gesture within it
constexpr double k_trembles_m = 0.5e-3, k_trembles_rad = 1e-3;

double milliseconds_since(std::chrono::steady_clock::time_point begun) {
  return 1e3 * seconds_between(begun, std::chrono::steady_clock::now());
}

Result<tracker::Gesture> gesture_of(const scene::Control& control) {
  static const std::map<std::string, tracker::Gesture> gestures = {{"", tracker::Gesture::cover},
                                                                   {"cover", tracker::Gesture::cover},
                                                                   {"turn", tracker::Gesture::turn},
                                                                   {"lay", tracker::Gesture::lay}};
  const auto found = gestures.find(control.gesture);
  if (found != gestures.end()) return found->second;
  return error("scene.json: controls: {}: expected the gesture cover, turn or lay, found '{}'.",
               control.marker.text(), control.gesture);
}

// What to look for: bodies and controls.
std::vector<std::string> families_of(const scene::Scene& scene, std::vector<Body> bodies) {
  for (const scene::Control& control : scene.controls)
    bodies.push_back({"(control)", {{control.marker, 0, Pose{}}}});
  return tracker::families_of(bodies);
}

}  // namespace

bool is_elsewhere(const Pose& before, const Pose& now) {
  return (before.translation - now.translation).norm() > k_trembles_m ||
         angle_between(before.rotation, now.rotation) > k_trembles_rad;
}

Result<Watcher> Watcher::create(const scene::Scene& scene, const Rig& rig, const WatchOptions& options) {
  LIMN_CHECK(options.full_scan_every > 0);
  Watcher out;
  out.rig_ = rig;
  out.options_ = options;
  out.bodies_ = scene::bodies(scene);
  LIMN_TRY(const tracker::Families families,
           tracker::Families::load(families_of(scene, out.bodies_), scene.folder));
  std::vector<tracker::GestureReader> gestures;
  for (const scene::Control& control : scene.controls) {
    LIMN_TRY(const tracker::Gesture gesture, gesture_of(control));
    gestures.emplace_back(control.marker, gesture);
  }
  for (const Imager& camera : rig.cameras)
    out.eyes_.push_back(
        {tracker::Detector(families, {.encoding = encoding_of(rig, camera)}), gestures, 0, {}});
  out.used_at_.resize(scene.controls.size());
  out.watched_.frames.resize(rig.cameras.size());
  out.watched_.detections.resize(rig.cameras.size());
  return out;
}

const Watched& Watcher::watch(std::span<const Frame> frames) {
  const auto begun = std::chrono::steady_clock::now();
  watched_.uses.clear();
  std::vector<std::size_t> cameras;
  for (const Frame& frame : frames) {
    const auto camera = std::find_if(rig_.cameras.begin(), rig_.cameras.end(),
                                     [&](const Imager& c) { return c.name == frame.camera; });
    LIMN_CHECK(camera != rig_.cameras.end());
    cameras.push_back(static_cast<std::size_t>(camera - rig_.cameras.begin()));
    look(cameras.back(), frame);
    watched_.captured_at = std::max(watched_.captured_at, frame.captured_at);
  }
  read_gestures(cameras);
  watched_.detect_ms = milliseconds_since(begun);

  const auto filtering = std::chrono::steady_clock::now();
  std::vector<tracker::View> views;
  for (const std::size_t i : cameras) views.push_back({&rig_.cameras[i], watched_.detections[i]});
  if (!views.empty())
    watched_.motions =
        tracker::observed(watched_.motions, bodies_, views, watched_.captured_at, options_.motion);
  watched_.filter_ms = milliseconds_since(filtering);
  return watched_;
}

// Markers are followed where they were; all of the picture is searched for others now and then, and when one
// is gone.
void Watcher::look(std::size_t camera, const Frame& frame) {
  Eye& eye = eyes_[camera];
  const Lens* lens = &rig_.cameras[camera].lens;
  std::vector<tracker::Detection>& detections = watched_.detections[camera];
  watched_.frames[camera] = frame;
  const cv::Mat grey = to_grey(frame.image);
  eye.detector.follow(grey, lens, detections, &eye.followed);
  const bool search =
      eye.pictures++ % options_.full_scan_every == 0 || eye.followed.size() < detections.size();
  std::swap(detections, eye.followed);
  if (search) eye.detector.detect_more(grey, lens, &detections);
}

// A control is used when one camera sees the gesture and none of the others sees the marker uncovered.
void Watcher::read_gestures(std::span<const std::size_t> cameras) {
  for (const std::size_t camera : cameras) {
    Eye& eye = eyes_[camera];
    const Frame& frame = watched_.frames[camera];
    const cv::Mat grey = eye.gestures.empty() ? cv::Mat() : to_grey(frame.image);
    for (std::size_t i = 0; i < eye.gestures.size(); ++i) {
      const int steps = eye.gestures[i].read(grey, watched_.detections[camera], frame.captured_at);
      if (steps == 0) continue;
      const bool is_seen_elsewhere =
          !eye.gestures[i].is_seen() && std::any_of(eyes_.begin(), eyes_.end(), [&](const Eye& other) {
            return &other != &eye && other.gestures[i].is_seen();
          });
      const bool is_known =
          used_at_[i] != Stamp{} && seconds_between(used_at_[i], frame.captured_at) < k_once_s;
      if (is_seen_elsewhere || is_known) continue;
      used_at_[i] = frame.captured_at;
      watched_.uses.push_back({i, steps});
    }
  }
}

}  // namespace limn::apps
