#pragma once

#include <opencv2/aruco/dictionary.hpp>

#include "calib/board/board.h"

namespace limn::calib {

/// OpenCV's table of a ChArUco board's markers. For use in this folder only, because it needs OpenCV's
/// headers.
cv::Ptr<cv::aruco::Dictionary> dictionary_of(const Board& board);

}  // namespace limn::calib
