#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/rig.h"
#include "projector/misalignment_detector.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "session/perception.h"
#include "session/projection_history.h"

namespace limn::session {

/// A device that is no longer at its calibrated pose.
struct Drift {
  /// One of these has moved. With one camera and one projector nobody can say which.
  std::vector<std::string> devices;
  double px = 0;  ///< displacement of its light in the camera's image, pixels
  double mm = 0;  ///< the same on the prototype

  bool operator==(const Drift&) const = default;
};

/// A message that says what is wrong and what to do.
std::string sentence(const Drift& drift);

/// Decides when people get a message about drift, and remembers the last one.
class DriftNotices {
 public:
  /// A message when another device has moved than was last reported, or when all are back in place; otherwise
  /// nullopt.
  std::optional<std::string> new_notice(const std::optional<Drift>& drift);
  /// The drift that was last reported.
  const std::optional<Drift>& reported() const { return reported_; }
  /// To be called when the rig is replaced: nothing has been reported about the new one yet.
  void forget() { reported_.reset(); }

 private:
  std::optional<Drift> reported_;
};

/// Detects from the projected light whether cameras and projectors are still at their calibrated poses: it
/// looks for the device whose motion explains best what all cameras see. Each call compares only some cells
/// of an image, so that none takes long. Works only while the prototype rests and something with edges is
/// projected.
class DriftWatch {
 public:
  explicit DriftWatch(const Rig& rig);

  /// Compares some cells of the newest frames. `posed` and `tracks` (of `bodies`) are what the light shown
  /// now was drawn for.
  void compare(const Percepts& percepts,
               const scene::PosedScene& posed,
               std::span<const Body> bodies,
               std::span<const Constellation> constellations,
               std::span<const Track> tracks,
               const ProjectionHistory& shown,
               projector::Renderer* renderer);

  /// The moved device. It is set after it was found for some seconds (k_holds_s), and cleared after the
  /// device was back in place for as long.
  const std::optional<Drift>& drift() const { return drift_; }

 private:
  std::optional<Drift> judged() const;
  void settle(std::optional<Drift> found, Stamp at);

  Rig rig_;
  std::vector<projector::MisalignmentDetector> lights_;  // one per camera
  std::size_t turn_ = 0;                                 // index of the camera that is compared
  Stamp began_at_, compared_at_;                         // start and newest step of its comparison
  std::optional<Pose> placed_;  // world_from_prototype for which the light was predicted
  std::optional<Pose> rests_;   // world_from_prototype where it rests
  Stamp rests_since_;
  std::optional<Drift> drift_;
  std::optional<Stamp> differs_since_;  // since when the findings differ from drift_
};

}  // namespace limn::session
