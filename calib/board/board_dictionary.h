#pragma once

#include <opencv2/aruco/dictionary.hpp>

#include "calib/board/board.h"

namespace limn::calib {

/// OpenCV's table of a ChArUco board's markers; within this room only, for it drags OpenCV's headers along.
cv::Ptr<cv::aruco::Dictionary> dictionary_of(const Board& board);

}  // namespace limn::calib
