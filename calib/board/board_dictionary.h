#pragma once

#include <optional>

#include "calib/board/board.h"
#include "core/opencv_markers.h"

namespace limn::calib {

/// The dictionary of a board's markers. Error: OpenCV's dictionaries cannot be loaded. Board::parse has made
/// sure that they can be.
Result<OpencvDictionary> dictionary_of(const Board& board);

/// Width of the border of an AprilGrid's tags, in cells.
constexpr int k_aprilgrid_border = 2;

/// Cells along a side of an AprilGrid's tag, its border included.
int aprilgrid_tag_cells(const Board& board);

/// The id of the tag in a square; nullopt where there is none.
std::optional<int> aprilgrid_tag(const Board& board, int column, int row);

}  // namespace limn::calib
