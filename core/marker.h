#pragma once

#include <string>
#include <vector>

#include "core/pose.h"
#include "core/result.h"

namespace limn {

/// `family:id`, such as `apriltag_36h11:0`, `aruco_4x4_50:3`, `artoolkit:hiro.patt`. Everything after the
/// last colon is the id, so that `aruco:FILE.yml:7` has the family `aruco:FILE.yml`.
struct MarkerName {
  std::string family;
  std::string id;

  static Result<MarkerName> parse(const std::string& text);
  std::string text() const { return family + ":" + id; }
  auto operator<=>(const MarkerName&) const = default;
};

/// A square marker on a body. Marker frame: origin at the centre, x right, y down, z into the paper.
/// size_m is the side of the black square's outer edge.
struct BodyMarker {
  MarkerName marker;
  double size_m = 0;
  Pose body_from_marker;
};

/// A rigid thing that markers stand on: the prototype, or a slot's single marker.
struct Body {
  std::string name;
  std::vector<BodyMarker> markers;
};

}  // namespace limn
