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

namespace limn::apps {

/// Two cameras whose images come under each other's names: as named, they see a body in two places; with
/// the two exchanged all of them see it in one. `detections`: of one moment, a camera each in the rig's
/// order. None where no body is seen by two cameras, and where an exchange does not explain what is seen.
std::optional<std::pair<std::string, std::string>> swapped_cameras(
    const Rig& rig,
    std::span<const Body> bodies,
    std::span<const std::vector<tracker::Detection>> detections,
    Stamp captured_at);

/// Looks for swapped cameras while a session runs, now and then, until some were found.
class SwappedCamerasCheck {
 public:
  /// What people are to be told, once.
  std::optional<std::string> check(const Rig& rig,
                                   std::span<const Body> bodies,
                                   std::span<const std::vector<tracker::Detection>> detections,
                                   Stamp captured_at);
  /// The rig is another one from now on.
  void begin_anew(Stamp at);

 private:
  Stamp compared_at_;
  bool has_told_ = false;
};

}  // namespace limn::apps
