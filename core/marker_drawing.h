#pragma once

#include <opencv2/core/mat.hpp>

namespace limn {

/// A marker as it is printed: 8-bit grey, square, upright.
struct MarkerDrawing {
  cv::Mat image;
  /// How far the image extends beyond the marker's square, on every side: cells around the square (AprilTag
  /// 3), or a dark ring around a light square. 0 for dark squares; white paper around them is not drawn.
  int around_px = 0;

  /// The square's side / the image's side.
  double square_share() const { return 1 - 2.0 * around_px / image.cols; }
};

}  // namespace limn
