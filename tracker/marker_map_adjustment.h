#pragma once

#include <span>
#include <vector>

#include "core/marker.h"
#include "core/result.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {

/// A body after bundle adjustment; vectors run parallel to the body's markers.
struct Adjustment {
  Body body;
  std::vector<Matrix6d>
      covariance;         ///< covariance of boxplus(body_from_marker, delta); zero for the fixed marker
  std::vector<int> seen;  ///< number of images that each marker was used in
  int images = 0;
  double rms_px = 0;  ///< for each corner
};

/// Bundle adjustment (Levenberg-Marquardt) of the body's pose in every image and of every marker's pose on
/// the body except the fixed one. It minimises the pixel residuals of all corners through the true lenses,
/// weighted by their covariance, with a Huber loss. Each view is an image of a different moment. Error: no
/// image shows two markers of the body, or the corners do not determine all markers.
Result<Adjustment> adjusted_marker_map(const Body& start,
                                       const MarkerName& fixed,
                                       std::span<const View> views);

}  // namespace limn::tracker
