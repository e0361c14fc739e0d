#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace limn::tracker {

/// The cells of a code's marker: a square grid that includes the border, and what lies around it where the
/// code has cells outside of its black square. It looks the same when turned by 90 degrees.
struct CodeGrid {
  static constexpr int k_max_width = 11;
  // What a cell shows that shows no bit.
  static constexpr std::int8_t k_dark = -1;    ///< the border
  static constexpr std::int8_t k_light = -2;   ///< the ring around the square, where cells lie outside of it
  static constexpr std::int8_t k_unused = -3;  ///< anything; drawn light

  int width = 0;  ///< cells along a side
  int rings = 0;  ///< how many of them lie outside of the black square, on every side
  int bits = 0;
  /// Row by row: the number of the bit that a cell shows (the last one is 0, the lowest bit of the code), or
  /// one of the constants above.
  std::vector<std::int8_t> cells = {};

  /// Cells along a side of the black square, border included.
  int side() const { return width - 2 * rings; }
  std::int8_t at(int row, int column) const { return cells[static_cast<std::size_t>(row * width + column)]; }
};

/// cells x cells bits inside a border that is `border` cells wide.
CodeGrid grid_inside_border(int cells, int border);

/// A black square `side` cells wide whose border is one cell wide, in a light ring one cell wide, in rings of
/// further cells. `has_bit` holds 1 for each cell of the width x width grid that shows a bit.
CodeGrid grid_around_border(int width, int side, const std::vector<std::uint8_t>& has_bit);

/// The code as it is read when the marker's own top-left corner lies at the k-th corner of the quad
/// (clockwise), for k = 0 … 3.
std::array<std::uint64_t, 4> four_turns(std::uint64_t code, const CodeGrid& grid);

}  // namespace limn::tracker
