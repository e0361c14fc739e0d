#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/result.h"
#include "core/rig.h"
#include "core/track.h"
#include "scene/scene.h"
#include "tracker/balls/ball_finder.h"
#include "tracker/balls/constellation_filter.h"
#include "tracker/body_filter.h"
#include "tracker/detector.h"
#include "tracker/feeds/foreign_tracker.h"
#include "tracker/gesture.h"

namespace limn::session {

/// A use of a control of the scene. `control` is its index; `steps` is -1 for a turn backwards.
struct ControlUse {
  std::size_t control = 0;
  int steps = 1;
};

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

/// What other tracking systems have sent since the moment before: the poses of each, in the order of
/// PerceptionOptions::feeds, and messages about what was refused.
struct FeedInput {
  std::vector<std::vector<tracker::ArrivedPose>> poses = {};
  std::vector<std::string> notes = {};

  bool is_empty() const {
    return std::ranges::all_of(poses, [](const auto& of_feed) { return of_feed.empty(); });
  }
};

/// The results of perception after the frames of one moment.
struct Percepts {
  std::vector<Frame> frames;                                ///< newest of each camera, in the rig's order
  std::vector<std::vector<tracker::Detection>> detections;  ///< in these frames, one list per camera
  std::vector<std::vector<tracker::Ball>> balls;  ///< in these frames; empty when the scene has none
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

  /// Processes the frames of one moment, at most one per camera, and what other tracking systems have sent; a
  /// camera without a frame keeps its last detections. The result stays valid until the next call.
  const Percepts& watch(std::span<const Frame> frames, const FeedInput& input = {});
  const Percepts& percepts() const { return percepts_; }

 private:
  struct CameraState {
    tracker::Detector detector;
    std::vector<tracker::GestureReader> gestures;  // one per control
    int until_search = 0, searches = 0;
    std::vector<tracker::Detection> before = {};  // detections in the image before the newest
    Stamp seen_at = {};                           // stamp of the newest image
    double seconds = 0;                           // time between the last two images
    cv::Mat grey = {};                            // the newest image
    tracker::BallFinder ball_finder = tracker::BallFinder();
  };
  struct Loose {
    MarkerName marker;
    int moments = 0;  // number of moments in which it was seen
    Stamp seen_at;
    std::optional<Pose> anchor;
    Stamp still_since;
  };
  Perception() = default;
  void update_camera(std::size_t camera, const Frame& frame);
  void find_markers(std::size_t camera, Stamp captured_at);
  void filter(std::span<const std::size_t> cameras, const FeedInput& input);
  void filter_seen(std::span<const std::size_t> cameras);
  bool all_are_seen() const;
  void note_loose(std::span<const std::size_t> cameras);
  void follow_loose();
  void follow_feeds(bool has_frames, const FeedInput& input);
  void read_gestures(std::span<const std::size_t> cameras);

  Rig rig_;
  PerceptionOptions options_;
  std::vector<Body> bodies_;
  std::vector<Constellation> constellations_;
  double loose_size_m_ = 0;
  std::vector<MarkerName> used_;  // markers of bodies and controls
  std::vector<Loose> loose_;
  std::vector<CameraState> camera_states_;  // one per camera
  std::vector<Stamp> used_at_;              // one per control
  std::vector<tracker::BodyFilter> seen_;   // motions by the cameras alone
  std::vector<tracker::ForeignTracker> feeds_;
  Percepts percepts_;
};

}  // namespace limn::session
