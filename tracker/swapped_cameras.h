#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/frame.h"
#include "core/marker.h"
#include "core/rig.h"
#include "tracker/detection.h"

namespace limn::tracker {

/// Finds two cameras whose images come under each other's names: with these names they see a body in two
/// places, with the names exchanged all cameras see it in one place. `detections`: of one moment, one list
/// per camera in the rig's order. nullopt: no body is seen by two cameras, the cameras agree, or an exchange
/// does not make them agree.
std::optional<std::pair<std::string, std::string>> swapped_cameras(
    const Rig& rig,
    std::span<const Body> bodies,
    std::span<const std::vector<Detection>> detections,
    Stamp captured_at);

/// Checks for swapped cameras from time to time while a session runs, until some were found.
class SwappedCamerasCheck {
 public:
  /// A message for people, once; otherwise nullopt.
  std::optional<std::string> check(const Rig& rig,
                                   std::span<const Body> bodies,
                                   std::span<const std::vector<Detection>> detections,
                                   Stamp captured_at);
  /// To be called when the rig was replaced: checks again.
  void begin_anew(Stamp at);

 private:
  Stamp compared_at_;
  bool has_warned_ = false;
};

}  // namespace limn::tracker
