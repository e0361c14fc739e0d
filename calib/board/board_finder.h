#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/board/board.h"

namespace limn::calib {

/// An inner corner, or the centre of a circle, found in an image.
struct BoardCorner {
  int id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  /// Standard deviation of one coordinate, from the fit's residual and geometry; at least k_corner_floor_px.
  double stddev_px = 0;
};
/// Residual error of a perfect fit in 8 bits: lens blur and aliasing that the corner model does not contain.
constexpr double k_corner_floor_px = 0.005;

/// Finds the board's corners in an 8-bit grey image, sorted by id; empty when the board is not visible.
/// ChArUco boards and AprilGrids may be partly visible, chessboards must be completely visible. OpenCV's
/// detectors find the corners, then each corner is refined by fitting two blurred edges that cross (least
/// squares over the pixels along both edges, up to 0.42 squares away, clear of the markers). So nothing
/// depends on OpenCV's interpolation, which in 4.6 shifts ChArUco corners by half a pixel. A chessboard with
/// an even number of squares both ways looks the same when turned by 180 degrees: its first corner is the one
/// nearer to the image's top left. Circle grids:
/// calib/board/circle_finder.h.
std::vector<BoardCorner> find_board(const Board& board, const cv::Mat& grey);

}  // namespace limn::calib
