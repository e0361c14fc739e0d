#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/marker.h"
#include "core/result.h"
#include "tracker/sighting.h"

namespace limn::tracker {

/// Where a marker was found to stand on its body, and how sure that is.
struct LearnedMarker {
  BodyMarker marker;
  /// Of boxplus(body_from_marker, delta), relative to the marker that gives the frame (whose own is zero):
  /// from the corners' covariance, widened where the residuals are larger than that says.
  Matrix6d covariance = Matrix6d::Zero();
  int pictures = 0;  ///< that it was used in
};

/// A rigid thing as its pictures show it.
struct LearnedBody {
  std::vector<LearnedMarker> markers;  ///< by name
  MarkerName frame;                    ///< the body's frame is this marker's: the one seen in most pictures
  int pictures = 0;                    ///< used
  double rms_px = 0;                   ///< per corner
  std::vector<MarkerName> unplaced;    ///< seen, but in no picture together with a placed one
};

/// Learns where markers of one size stand on a rigid thing, from pictures that show two or more of them each,
/// the thing turned from picture to picture. A view is one picture of its own moment. Relative poses that
/// most pictures agree on (over both planar branches) start a bundle adjustment of all corners, over the
/// thing's pose in each picture and each marker's on the thing. A marker twice in a picture is left out
/// there. Error: no two markers in one picture, or an adjustment without a minimum.
Result<LearnedBody> learned_body(std::span<const View> views, double size_m);

/// The body as world_from_body and observed take it.
Body as_body(const LearnedBody& learned, const std::string& name);

}  // namespace limn::tracker
