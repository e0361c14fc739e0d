#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/marker.h"
#include "core/result.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {

/// A marker's measured pose on its body, with its uncertainty.
struct MappedMarker {
  BodyMarker marker;
  /// Covariance of boxplus(body_from_marker, delta), relative to the marker that defines the frame (its own
  /// is zero). It comes from the corners' covariance and is widened where the residuals are larger than that
  /// predicts.
  Matrix6d covariance = Matrix6d::Zero();
  int images = 0;  ///< number of images that it was used in
};

/// The markers on a rigid body, learned from images of it.
struct MarkerMap {
  std::vector<MappedMarker> markers;  ///< sorted by name
  MarkerName frame;                   ///< the marker whose frame is the body's: the one seen in most images
  int images = 0;                     ///< number of images used
  double rms_px = 0;                  ///< for each corner
  std::vector<MarkerName> unplaced;   ///< seen, but never in an image together with a placed marker
};

/// Learns the poses of markers of one size on a rigid body, from images that each show two or more of them;
/// the body is turned from image to image. Each view is an image of a different moment. The relative poses
/// that most images agree on (over both planar branches) start a bundle adjustment of all corners. Its
/// unknowns are the body's pose in each image and each marker's pose on the body. A marker that is found
/// twice in an image is ignored there. Error: no image shows two markers, or the adjustment has no minimum.
Result<MarkerMap> map_markers(std::span<const View> views, double size_m);

/// The body in the form that world_from_body and observed use.
Body as_body(const MarkerMap& learned, const std::string& name);

}  // namespace limn::tracker
