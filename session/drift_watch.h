#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/rig.h"
#include "projector/misalignment_detector.h"
#include "projector/renderer.h"
#include "scene/posed_scene.h"
#include "session/perception.h"
#include "session/projection_history.h"

namespace limn::apps {

/// A device that does not stand where the rig says any more.
struct Drift {
  std::vector<std::string> devices;  ///< one of these: with one camera and one projector nobody can say which
  double px = 0;                     ///< by which its light lies beside its place, camera pixels
  double mm = 0;                     ///< the same on the prototype

  bool operator==(const Drift&) const = default;
};

/// What is wrong and what to do, in two sentences.
std::string sentence(const Drift& drift);

/// What people were told of drift.
class DriftNotices {
 public:
  /// The sentence to tell when what has moved is another device than was told.
  std::optional<std::string> news(const std::optional<Drift>& drift);
  /// What has moved, as far as people were told.
  const std::optional<Drift>& told() const { return told_; }
  /// The rig is another one: nothing is said of it yet.
  void forget() { told_.reset(); }

 private:
  std::optional<Drift> told_;
};

/// Watches by the light itself whether cameras and projectors stand where the rig says: of all devices the
/// one that, moved, explains best what all cameras see. Some cells of an image are compared at each call, so
/// that none takes long. Sees only while the prototype rests and something with edges is shown.
class DriftWatch {
 public:
  explicit DriftWatch(const Rig& rig);

  void look(const Percepts& watched,
            const scene::PosedScene& posed,
            const ProjectionHistory& shown,
            projector::Renderer* renderer);

  /// What has moved, once that has held for some seconds, until it stands right again for as long.
  const std::optional<Drift>& drift() const { return drift_; }

 private:
  std::optional<Drift> judged() const;
  void settle(std::optional<Drift> found, Stamp at);

  Rig rig_;
  std::vector<projector::MisalignmentDetector> lights_;  // one a camera
  std::size_t turn_ = 0;                                 // the camera that is looked at
  Stamp began_at_, compared_at_;                         // its look
  std::optional<Pose> placed_;                           // world_from_prototype that light was predicted for
  std::optional<Pose> rests_;                            // where the prototype is
  Stamp rests_since_;
  std::optional<Drift> drift_;
  std::optional<Stamp> differs_since_;  // what is found from drift_
};

}  // namespace limn::apps
