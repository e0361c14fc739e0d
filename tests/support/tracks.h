#pragma once

#include <string>

#include "core/track.h"

namespace limn::test {

/// The track of a body that is seen at this pose.
inline Track track_of(const std::string& body, const Pose& world_from_body) {
  Track track;
  track.body = body;
  track.world_from_body = world_from_body;
  return track;
}

}  // namespace limn::test
