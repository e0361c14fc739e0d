#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "calib/capture_set.h"
#include "calib/observations.h"

namespace limn::calib {

/// A board as an image shows it, whether or not it is the described one.
struct DetectedBoard {
  BoardKind kind = BoardKind::charuco;
  int columns = 0;           ///< squares across
  int rows = 0;              ///< squares down; for a ChArUco board as many as the visible markers prove
  std::string dictionary;    ///< dictionary of a ChArUco board's markers
  int markers = 0;           ///< number of visible markers that fit
  bool white_first = false;  ///< its top-left square is white: not a board printed by Limn
  std::string description() const;  ///< "a charuco board 11 squares across and at least 8 down, …"
};

/// Tries all of OpenCV's dictionaries, all widths of 3 to 30 squares, and chessboards of 3x3 corners and
/// more. Takes seconds; used to explain a failure.
std::optional<DetectedBoard> identify_board(const cv::Mat& grey);

/// Returns an error when no image shows even half of the described board, but one shows another board: with
/// more or fewer squares across, another dictionary, a chessboard instead of a ChArUco board or the reverse.
/// The error names image and board.
Status check_board(const CaptureSet& captures, const Observations& observations);

}  // namespace limn::calib
