#pragma once

#include <string>

#include "core/frame.h"
#include "core/pose.h"

namespace limn {

/// What a track's pose rests on.
enum class TrackingState {
  measured,      ///< seen in the newest image
  extrapolated,  ///< not seen there: carried on from what was seen before, for a limited time
  lost           ///< unseen for longer than that; the pose is the last one known and not to be shown
};

/// Where a body is at a moment, and how sure that is. Covariance as in boxplus (core/pose.h).
struct Track {
  std::string body;
  Pose world_from_body;
  Matrix6d covariance = Matrix6d::Zero();
  int marker_count = 0;
  double rms_px = 0;
  Stamp captured_at;  ///< of the newest image that the body was measured in
  Stamp at;           ///< the moment that the pose is for: captured_at, or later when predicted
  TrackingState tracking = TrackingState::measured;
};

}  // namespace limn
