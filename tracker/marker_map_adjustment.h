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
  std::vector<Matrix6d> covariance;  ///< of boxplus(body_from_marker, delta); zero for the fixed marker
  std::vector<int> seen;             ///< images that each marker was used in
  int images = 0;
  double rms_px = 0;  ///< per corner
};

/// Levenberg-Marquardt over the body's pose in every image and every marker's pose on the body but the
/// fixed one, on the pixels of all corners through the true lenses, weighted by their covariance, with a
/// Huber loss. A view is one image of its own moment. Error: fewer than two markers of the body in every
/// image, or markers that the corners do not fix.
Result<Adjustment> adjusted_marker_map(const Body& start,
                                       const MarkerName& fixed,
                                       std::span<const View> views);

}  // namespace limn::tracker
