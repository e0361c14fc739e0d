#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/board/board.h"

namespace limn::calib {

/// An inner corner found in an image.
struct BoardCorner {
  int id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  /// Of one coordinate, from the fit's residual and geometry; never below k_corner_floor_px.
  double stddev_px = 0;
};
/// What remains of a perfect fit in 8 bits: lens blur and aliasing that the junction's model lacks.
constexpr double k_corner_floor_px = 0.005;

/// The board's corners in an 8-bit grey image, by rising id; empty when it is not visible. ChArUco boards
/// may be seen in part, chessboards must be seen whole. Found by OpenCV's detectors, then each corner is
/// refined in the image by fitting two blurred edges that cross (least squares over the pixels along both
/// edges, up to 0.42 squares away, clear of the markers), so that nothing depends on OpenCV's interpolation,
/// which in 4.6 shifts ChArUco corners by half a pixel. A chessboard with an even number of squares both ways
/// looks the same when turned by 180 degrees: its first corner is the one nearer to the image's top left.
std::vector<BoardCorner> find_board(const Board& board, const cv::Mat& grey);

}  // namespace limn::calib
