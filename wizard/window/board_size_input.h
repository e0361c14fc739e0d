#pragma once

#include <array>
#include <string>

#include "calib/board/board.h"
#include "device/gui/gui.h"

namespace limn::wizard {

/// A person's entry of the printed board's size.
struct BoardSizeInput {
  static constexpr std::size_t k_most = 48;
  std::array<char, k_most> text{};  ///< as it is typed
  std::string taken = {};           ///< the lengths that the solve uses; empty: none yet
  std::string problem = {};         ///< what is wrong with `text`; empty: nothing
};

/// Draws where to lay callipers or a ruler on the board (from the first to the last inner corner, across and
/// down), a field for the two lengths, and a button. Returns whether lengths were taken now.
bool draw_board_size(gui::Gui& gui, const calib::Board& board, BoardSizeInput* input);

}  // namespace limn::wizard
