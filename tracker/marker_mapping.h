#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/marker.h"
#include "core/result.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {

/// Where a marker was found to stand on its body, and how sure that is.
struct MappedMarker {
  BodyMarker marker;
  /// Of boxplus(body_from_marker, delta), relative to the marker that gives the frame (whose own is zero):
  /// from the corners' covariance, widened where the residuals are larger than that says.
  Matrix6d covariance = Matrix6d::Zero();
  int images = 0;  ///< that it was used in
};

/// A rigid thing as its images show it.
struct MarkerMap {
  std::vector<MappedMarker> markers;  ///< by name
  MarkerName frame;                   ///< the body's frame is this marker's: the one seen in most images
  int images = 0;                     ///< used
  double rms_px = 0;                  ///< per corner
  std::vector<MarkerName> unplaced;   ///< seen, but in no image together with a placed one
};

/// Learns where markers of one size stand on a rigid thing, from images that show two or more of them each,
/// the thing turned from image to image. A view is one image of its own moment. Relative poses that
/// most images agree on (over both planar branches) start a bundle adjustment of all corners, over the
/// thing's pose in each image and each marker's on the thing. A marker twice in an image is left out
/// there. Error: no two markers in one image, or an adjustment without a minimum.
Result<MarkerMap> map_markers(std::span<const View> views, double size_m);

/// The body as world_from_body and observed take it.
Body as_body(const MarkerMap& learned, const std::string& name);

}  // namespace limn::tracker
