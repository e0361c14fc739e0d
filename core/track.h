#pragma once

#include <string>

#include "core/frame.h"
#include "core/pose.h"

namespace limn {

/// What a track's pose is based on.
enum class TrackingState {
  measured,      ///< The body was seen in the newest image.
  extrapolated,  ///< Not seen there: the pose is predicted from earlier images, for a limited time.
  lost           ///< Not seen for longer than that. The pose is the last known one and must not be shown.
};

/// The pose of a body at a moment, with its covariance (as in boxplus, core/pose.h).
struct Track {
  std::string body;
  Pose world_from_body;
  Matrix6d covariance = Matrix6d::Zero();
  int marker_count = 0;
  double rms_px = 0;
  Stamp captured_at;  ///< Capture time of the newest image in which the body was measured.
  Stamp at;           ///< The moment of the pose: captured_at, or later when predicted.
  TrackingState tracking = TrackingState::measured;
};

}  // namespace limn
