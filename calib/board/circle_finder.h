#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/board/board_finder.h"

namespace limn::calib {

/// Finds the centres of a circle grid's circles in an 8-bit grey image, sorted by id; empty when not the
/// whole grid is visible. OpenCV finds the grid; then the edge of each circle is measured where rays from its
/// centre cross the middle between ink and paper, and the centroid of the enclosed area is taken. The image
/// of a circle's centre is not the centroid of the circle's image: perspective and lens distortion move it.
/// That difference is computed from the map from board to image that all centres together give (a homography
/// and a polynomial of third degree) and from the circles' radius, and subtracted, until it does not change
/// (compare Heikkila, "Geometric camera calibration using circular control points", PAMI 2000; no lens is
/// needed here). A grid that looks the same when turned by 180 degrees begins with the corner that is nearer
/// to the image's top left.
std::vector<BoardCorner> find_circle_grid(const Board& board, const cv::Mat& grey);

}  // namespace limn::calib
