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

}  // namespace limn::apps
