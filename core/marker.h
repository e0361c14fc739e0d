#pragma once

#include <string>
#include <vector>

#include "core/pose.h"
#include "core/result.h"

namespace limn {

/// Largest side of a marker (mm); larger numbers are mistakes.
inline constexpr double k_largest_marker_mm = 1e5;

/// A marker's name `family:id`, such as `apriltag_36h11:0`, `aruco_4x4_50:3`, `artoolkit:hiro.patt`. The id
/// is everything after the last colon, so that `aruco:FILE.yml:7` has the family `aruco:FILE.yml`.
struct MarkerName {
  std::string family;
  std::string id;

  static Result<MarkerName> parse(const std::string& text);
  std::string text() const { return family + ":" + id; }
  auto operator<=>(const MarkerName&) const = default;
};

/// A square marker on a body. Marker frame: origin at the centre, x right, y down, z into the paper.
/// size_m is the side length of the black square, measured at its outer edge.
struct BodyMarker {
  MarkerName marker;
  double size_m = 0;
  Pose body_from_marker;
};

/// A rigid thing with markers on it: the prototype, or a slot's single marker.
struct Body {
  std::string name;
  std::vector<BodyMarker> markers;
};

}  // namespace limn
