#pragma once

#include <Eigen/Core>
#include <array>

#include "core/marker.h"

namespace limn::tracker {

/// A marker found in a picture.
struct Detection {
  MarkerName marker;
  /// Top-left, top-right, bottom-right, bottom-left of the black square in the marker's own upright frame;
  /// pixels of the raw picture, pixel centres at integers.
  std::array<Eigen::Vector2d, 4> corners_px;
  /// Covariance of each corner (px^2), from the residuals of its two edge lines plus what edge lines keep as
  /// systematic error (refine.h).
  std::array<Eigen::Matrix2d, 4> corner_covariance;
  /// False where a corner itself is covered and only follows from what is seen of its two sides.
  std::array<bool, 4> corner_visible = {true, true, true, true};
  /// Probability that the id is right, 0.9 … 1, for codes, barcodes and templates alike (identify.h): of what
  /// is as sure as this, so many are right.
  double score = 0;
};

}  // namespace limn::tracker
