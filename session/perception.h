#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/frame.h"
#include "core/result.h"
#include "core/rig.h"
#include "core/track.h"
#include "scene/scene.h"
#include "tracker/body_filter.h"
#include "tracker/detector.h"
#include "tracker/gesture.h"

namespace limn::apps {

/// A control of the scene (by its index) was used: `steps` is -1 for a turn backwards.
struct ControlUse {
  std::size_t control = 0;
  int steps = 1;
};

/// A marker that lies still for so long may be paired.
inline constexpr double k_lies_after_s = 1;

/// A marker that carries nothing in the scene, seen for a while. Its body is scene::loose_body(marker).
struct LooseMarker {
  MarkerName marker;
  Pose world_from_marker;
  /// It has not been moved by 5 mm or 5 degrees since; once it lies, by 10 mm or 45 degrees: what is offered
  /// must not come and go with a small marker's noise in depth and tilt.
  Stamp still_since;
};

/// What is known after a moment's images.
struct Percepts {
  std::vector<Frame> frames;                                ///< newest of each camera, in the rig's order
  std::vector<std::vector<tracker::Detection>> detections;  ///< in them
  std::vector<tracker::BodyFilter> motions;
  std::vector<LooseMarker> loose;  ///< seen in the newest images; the one that lies longest first
  std::vector<ControlUse> uses;    ///< made in this moment
  Stamp captured_at;
  std::vector<Track> tracks;  ///< where bodies are at captured_at, by the filter
  double detect_ms = 0, filter_ms = 0;
};

struct PerceptionOptions {
  /// Every how many images of a camera all of it is searched, a third as often while all markers of the
  /// scene are seen; between, markers are followed where they should be by now. Higher is faster and finds
  /// new markers later.
  int full_scan_every = 3;
  tracker::MotionModel motion;
  int most_loose = 8;  ///< markers that carry nothing; more are not looked at
};

/// How large loose markers are taken to be: as the scene's first slot's, m; 0 without slots: none are looked
/// at.
double loose_size_m(const scene::Scene& scene);

/// The camera side of a session: frames -> markers -> motions of bodies, and gestures of control markers.
/// The same frames give the same answers; no clock but the frames' stamps.
class Perception {
 public:
  /// Error: a family that cannot be loaded, a control whose gesture is unknown.
  static Result<Perception> create(const scene::Scene& scene,
                                   const Rig& rig,
                                   const PerceptionOptions& options = {});

  /// Takes frames of one moment (at most one a camera; cameras without one keep what they saw). The result
  /// stays valid until the next call.
  const Percepts& watch(std::span<const Frame> frames);
  const Percepts& watched() const { return watched_; }

 private:
  struct Eye {
    tracker::Detector detector;
    std::vector<tracker::GestureReader> gestures;  // one a control
    int until_search = 0, searches = 0;
    std::vector<tracker::Detection> before = {};  // in the image before the newest
    Stamp seen_at = {};                           // the newest
    double seconds = 0;                           // between the two
    cv::Mat grey = {};                            // the newest image
  };
  struct Loose {
    MarkerName marker;
    int moments = 0;  // that showed it
    Stamp seen_at;
    std::optional<Pose> anchor;
    Stamp still_since;
  };
  Perception() = default;
  void look(std::size_t camera, const Frame& frame);
  bool all_are_seen() const;
  void note_loose(std::span<const std::size_t> cameras);
  void follow_loose();
  void read_gestures(std::span<const std::size_t> cameras);

  Rig rig_;
  PerceptionOptions options_;
  std::vector<Body> bodies_;
  double loose_size_m_ = 0;
  std::vector<MarkerName> used_;  // by bodies and controls
  std::vector<Loose> loose_;
  std::vector<Eye> eyes_;       // one a camera
  std::vector<Stamp> used_at_;  // one a control
  Percepts watched_;
};

}  // namespace limn::apps
