#pragma once

#include <Eigen/Core>
#include <array>

#include "tracker/candidates.h"
#include "tracker/detection.h"
#include "tracker/segments.h"

namespace limn::tracker {

/// The place of a marker that was found in the image. No other marker is searched for there.
class ExclusionZone {
 public:
  explicit ExclusionZone(const Detection& detection);

  /// Whether both ends of a segment lie in the marker's square or next to it.
  bool holds(const Segment& segment) const {
    return (segment.from - corner_).squaredNorm() < around_square_ && holds_both_ends(segment);
  }

  /// Whether the quadrilateral's middle lies near the marker's.
  bool takes(const Quad& quad) const;

 private:
  bool holds_both_ends(const Segment& segment) const;

  Eigen::Vector2d corner_, middle_;
  double half_square_;    // square of half the longest side, px^2
  double around_square_;  // square of the distance from corner_ beyond which nothing lies in the marker, px^2
  std::array<Eigen::Vector2d, 4> inward_;
  std::array<double, 4> offset_;
};

}  // namespace limn::tracker
