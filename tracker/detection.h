#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "core/marker.h"
#include "tracker/pattern_appearance.h"

namespace limn::tracker {

/// The light at a marker's sides when none of them was found to lie on a shadow's edge (shadow_edges.h).
/// While it stays, no shadow has come, and Detector::follow need not look for one.
struct UnshadowedSides {
  std::array<double, 4> outside_level, inside_level;  ///< grey levels
  int age = 0;                                        ///< images since
  int kept_for = 0;                                   ///< images
};

/// A marker found in an image.
struct Detection {
  MarkerName marker;
  /// Top-left, top-right, bottom-right, bottom-left of the black square in the marker's own upright frame;
  /// pixels of the raw image, pixel centres at integers.
  std::array<Eigen::Vector2d, 4> corners_px;
  /// Covariance of each corner (px^2), from the residuals of its two edge lines, their correlation along the
  /// side and what stands next to the edge; or from those of the whole pattern's fit.
  std::array<Eigen::Matrix2d, 4> corner_covariance;
  /// False where a corner itself is covered and only follows from what is seen of its two sides.
  std::array<bool, 4> corner_visible = {true, true, true, true};
  /// Probability that the id is right, 0.9 … 1, for codes, barcodes and templates alike (identify.h): of what
  /// is as sure as this, so many are right.
  double score = 0;
  /// Where blur mixes neighbouring edges: the marker's whole pattern, by which the corners were found, and
  /// from which Detector::follow finds it in the next image.
  std::optional<PatternAppearance> by_pattern;
  std::optional<UnshadowedSides> unshadowed;
};

}  // namespace limn::tracker
