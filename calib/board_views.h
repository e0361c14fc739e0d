#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "calib/observations.h"
#include "calib/shot_files.h"
#include "core/result.h"

namespace limn::calib {

/// Photographs of a board for a calibration of cameras alone.
struct BoardViews {
  std::filesystem::path folder;
  Board board;
  std::vector<std::string> cameras;
  /// files[camera]: photographs of one and the same pose; the one that shows most of the board is used.
  /// Empty: none.
  std::vector<ShotPose> poses;
};

/// The white images of captures, one for each projector.
BoardViews board_views(const CaptureSet& captures);

/// Finds the board in every photograph. The result has no projectors and no matches, and only those poses
/// that show the board to at least one camera; the others are named in a warning. Errors: an image that
/// cannot be read or has another size than the camera's others; no photograph that shows the board, with the
/// board that they show instead where that is known.
Result<Observed> observe_board(const BoardViews& views);

}  // namespace limn::calib
