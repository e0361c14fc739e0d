#pragma once

#include <string>

#include "core/frame.h"
#include "core/pose.h"

namespace limn {

/// Where a body was at a moment, and how sure that is. Covariance as in boxplus (core/pose.h).
struct Track {
  std::string body;
  Pose world_from_body;
  Matrix6d covariance = Matrix6d::Zero();
  int marker_count = 0;
  double rms_px = 0;
  Stamp captured_at;
};

}  // namespace limn
