#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tracker/cameras/camera_detections.h"

namespace limn::tracker {

/// A use of a control of the scene. `control` is its index; `steps` is -1 for a turn backwards.
struct ControlUse {
  std::size_t control = 0;
  int steps = 1;
};

/// Decides from the gestures in the images of all cameras when controls are used. A control is used when one
/// camera sees the gesture and no other camera sees the marker uncovered. If several controls are hidden
/// together, only the one hidden last counts: the arm hides the others on the hand's way.
class ControlUses {
 public:
  ControlUses(std::size_t cameras, std::size_t controls)
      : cameras_(cameras, Camera{0, std::vector<GestureReading>(controls)}), used_at_(controls) {}

  /// The uses that a camera's newest detections show. Those of another scene, with another number of
  /// controls, show none.
  std::vector<ControlUse> read(std::size_t camera, const CameraDetections& found);

 private:
  struct Camera {
    std::uint64_t run = 0;  // CameraDetections::run of the newest
    std::vector<GestureReading> controls;
  };
  bool is_use(const Camera& seen_by, const CameraDetections& found, std::size_t control) const;

  std::vector<Camera> cameras_;
  std::vector<Stamp> used_at_;  // one per control
};

}  // namespace limn::tracker
