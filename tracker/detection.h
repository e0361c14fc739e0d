#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "core/marker.h"
#include "tracker/pattern_appearance.h"

namespace limn::tracker {

/// Grey levels at a marker's sides when none of the sides lay on a shadow's edge (shadow_edges.h). While the
/// levels stay the same no shadow has come, and Detector::follow does not search for one.
struct UnshadowedSides {
  std::array<double, 4> outside_level, inside_level;  ///< grey levels
  int age = 0;                                        ///< images since the last search
  int kept_for = 0;                                   ///< after this many images the search is repeated
};

/// A marker found in an image.
struct Detection {
  MarkerName marker;
  /// Top-left, top-right, bottom-right and bottom-left corner of the black square in the marker's own upright
  /// frame; pixels of the raw image, pixel centres at integers.
  std::array<Eigen::Vector2d, 4> corners_px;
  /// Covariance of each corner (px^2). It comes from the residuals of the corner's two edge lines, their
  /// correlation along the side and other edges nearby, or from the residuals of the whole pattern's fit.
  std::array<Eigen::Matrix2d, 4> corner_covariance;
  /// False where a corner itself is covered and was computed from the visible parts of its two sides.
  std::array<bool, 4> corner_visible = {true, true, true, true};
  /// Probability that the id is right, 0.9 … 1, for codes, barcodes and templates alike (identify.h). It is
  /// calibrated: of all detections with score s, a share s is right.
  double score = 0;
  /// Set where blur mixes neighbouring edges: the marker's whole pattern, from which the corners were found,
  /// and with which Detector::follow finds it in the next image.
  std::optional<PatternAppearance> by_pattern;
  std::optional<UnshadowedSides> unshadowed;
};

}  // namespace limn::tracker
