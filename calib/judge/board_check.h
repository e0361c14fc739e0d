#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "calib/capture_set.h"
#include "calib/observations.h"

namespace limn::calib {

/// A board as an image shows it, whatever it should be.
struct DetectedBoard {
  BoardKind kind = BoardKind::charuco;
  int columns = 0;               ///< squares across
  int rows = 0;                  ///< squares down; of a ChArUco board as many as the markers in sight prove
  std::string dictionary;        ///< of a ChArUco board's markers
  int markers = 0;               ///< of them in sight that fit
  bool white_first = false;      ///< its top-left square is white: not a board of Limn's
  std::string description() const;  ///< "a charuco board 11 squares across and at least 8 down, …"
};

/// Tries all of OpenCV's dictionaries, all widths of 3 to 30 squares, and chessboards of 3x3 corners and
/// more. Seconds: for messages.
std::optional<DetectedBoard> identify_board(const cv::Mat& grey);

/// An error when no image shows even half of the described board, but one shows another: with more or fewer
/// squares across, another dictionary, a chessboard instead of a ChArUco board or the reverse. Names image
/// and board.
Status check_board(const CaptureSet& captures, const Observations& observations);

}  // namespace limn::calib
