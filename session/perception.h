#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/result.h"
#include "core/rig.h"
#include "core/track.h"
#include "scene/scene.h"
#include "tracker/balls/constellation_filter.h"
#include "tracker/body_filter.h"
#include "tracker/cameras/camera_detector.h"
#include "tracker/cameras/control_uses.h"
#include "tracker/feeds/foreign_tracker.h"

namespace limn::session {

using tracker::ControlUse;

/// A marker may be paired after it has been still for this long; seconds.
inline constexpr double k_lies_after_s = 1;

/// A marker that carries nothing in the scene and has been seen for a while. Its body is
/// scene::loose_body(marker).
struct LooseMarker {
  MarkerName marker;
  Pose world_from_marker;
  /// Since then the marker has moved by less than 5 mm and 5 degrees. After k_lies_after_s the limits are 10
  /// mm and 45 degrees, so that the offer to pair does not come and go with a small marker's noise in depth
  /// and tilt.
  Stamp still_since;
};

/// What other tracking systems and the nodes of a room have sent since the moment before.
struct FeedInput {
  /// The poses of each tracking system, in the order of PerceptionOptions::feeds.
  std::vector<std::vector<tracker::ArrivedPose>> poses = {};
  std::vector<std::string> notes = {};  ///< about what was refused
  /// What cameras show whose nodes detect, the newest, at most one per camera.
  std::vector<tracker::CameraDetections> detections = {};
  /// Images of such cameras. They are shown and compared, but nothing is detected in them.
  std::vector<Frame> images = {};

  bool has_poses() const {
    return !std::ranges::all_of(poses, [](const auto& of_feed) { return of_feed.empty(); });
  }
  bool is_empty() const { return !has_poses() && detections.empty() && images.empty(); }
};

/// The results of perception after the frames of one moment.
struct Percepts {
  /// The newest image of each camera, in the rig's order. A camera at a node may have none, or detections
  /// that are newer.
  std::vector<Frame> frames;
  std::vector<std::vector<tracker::Detection>> detections;  ///< the newest, one list per camera
  std::vector<std::vector<tracker::Ball>> balls;            ///< the newest; empty when the scene has none
  std::size_t screen_camera = 0;  ///< the first camera that sees visible light: screens show its frames
  std::vector<tracker::BodyFilter> motions;  ///< by the cameras and other tracking systems
  std::vector<LooseMarker> loose;  ///< tracked loose markers, the one that is still for longest first
  std::vector<ControlUse> uses;    ///< control uses of this moment
  std::vector<tracker::FeedStatus> feeds = {};  ///< how far other tracking systems can be used
  std::vector<std::string> feed_notes = {};     ///< what has changed there, as sentences for people
  Stamp captured_at;
  std::vector<Track> tracks;  ///< filtered tracks at captured_at
  double detect_ms = 0, filter_ms = 0;
};

struct PerceptionOptions {
  /// In every N-th image of a camera the whole image is searched for markers; a third as often while all
  /// markers of the scene are seen. In between, markers are followed near their predicted positions only.
  /// Higher is faster and finds new markers later.
  int full_scan_every = 3;
  tracker::MotionModel motion;
  tracker::TriplePose triple_pose = tracker::TriplePose::refined;
  int most_loose = 8;                          ///< at most so many loose markers; further ones are ignored
  std::vector<tracker::FeedSetup> feeds = {};  ///< other tracking systems
};

/// What is searched for in the images of a session's cameras. Error: a family that cannot be loaded.
Result<tracker::CameraDetectorSetup> camera_detector_setup(const scene::Scene& scene, int full_scan_every);

/// The camera side of a session: frames -> markers and balls -> motions of bodies, and gestures of control
/// markers. Its only clock is the frames' stamps, so the same frames give the same results.
class Perception {
 public:
  /// Error: a family that cannot be loaded.
  static Result<Perception> create(const scene::Scene& scene,
                                   const Rig& rig,
                                   const PerceptionOptions& options = {});

  /// A perception for another rig of the same session, which keeps what this one knows of other tracking
  /// systems.
  Result<Perception> successor(const scene::Scene& scene, const Rig& rig) const;

  /// Processes the frames of one moment, at most one per camera, and what other tracking systems and nodes
  /// have sent; a camera without a frame or detections keeps its last detections. The result stays valid
  /// until the next call.
  const Percepts& watch(std::span<const Frame> frames, const FeedInput& input = {});
  const Percepts& percepts() const { return percepts_; }

 private:
  struct Loose {
    MarkerName marker;
    int moments = 0;  // number of moments in which it was seen
    Stamp seen_at;
    std::optional<Pose> anchor;
    Stamp still_since;
  };
  Perception() = default;
  std::size_t number_of(const std::string& camera) const;
  const tracker::CameraDetections& detect(std::size_t camera, const Frame& frame);
  void note_found(std::size_t camera, const tracker::CameraDetections& found);
  void filter(std::span<const std::size_t> cameras, const FeedInput& input);
  void filter_seen(std::span<const std::size_t> cameras);
  void note_loose(std::span<const std::size_t> cameras);
  void follow_loose();
  void follow_feeds(bool has_frames, const FeedInput& input);

  Rig rig_;
  PerceptionOptions options_;
  std::vector<Body> bodies_;
  std::vector<Constellation> constellations_;
  double loose_size_m_ = 0;
  std::vector<MarkerName> used_;  // markers of bodies and controls
  std::vector<Loose> loose_;
  std::vector<tracker::CameraDetector> detectors_;  // one per camera
  std::optional<tracker::ControlUses> uses_;
  std::vector<tracker::BodyFilter> seen_;  // motions by the cameras alone
  std::vector<tracker::ForeignTracker> feeds_;
  Percepts percepts_;
};

}  // namespace limn::session
