#include "tracker/code_grid.h"

#include <algorithm>
#include <cstddef>

#include "core/result.h"

namespace limn::tracker {
namespace {

// How many cells a cell lies inside of the grid's edge.
int depth(const CodeGrid& grid, int row, int column) {
  const int last = grid.width - 1;
  return std::min({row, column, last - row, last - column});
}

// Numbers the cells that `role_of` says hold a bit (0), so that the first one is the highest bit.
template <typename RoleOf>
void fill(CodeGrid* grid, const RoleOf& role_of) {
  LIMN_CHECK(grid->width <= CodeGrid::k_max_width);
  for (int row = 0; row < grid->width; ++row)
    for (int column = 0; column < grid->width; ++column) {
      grid->cells.push_back(role_of(row, column));
      grid->bits += grid->cells.back() == 0;
    }
  LIMN_CHECK(grid->bits <= 64);
  int bit = grid->bits;
  for (std::int8_t& cell : grid->cells)
    if (cell == 0) cell = static_cast<std::int8_t>(--bit);
}

// The code turned clockwise by 90 degrees: the top left cell comes to the top right.
std::uint64_t turned(std::uint64_t code, const CodeGrid& grid) {
  std::uint64_t result = 0;
  for (int row = 0; row < grid.width; ++row)
    for (int column = 0; column < grid.width; ++column) {
      const int bit = grid.at(row, column);
      if (bit >= 0) result |= ((code >> grid.at(grid.width - 1 - column, row)) & 1) << bit;
    }
  return result;
}

}  // namespace

CodeGrid grid_inside_border(int cells, int border) {
  CodeGrid grid{.width = cells + 2 * border};
  fill(&grid, [&](int row, int column) -> std::int8_t {
    return depth(grid, row, column) < border ? CodeGrid::k_dark : std::int8_t{0};
  });
  return grid;
}

CodeGrid grid_around_border(int width, int side, const std::vector<std::uint8_t>& has_bit) {
  LIMN_CHECK(has_bit.size() == static_cast<std::size_t>(width * width));
  CodeGrid grid{.width = width, .rings = (width - side) / 2};
  fill(&grid, [&](int row, int column) -> std::int8_t {
    const int inside = depth(grid, row, column) - grid.rings;
    if (inside == 0) return CodeGrid::k_dark;
    if (inside == -1) return CodeGrid::k_light;
    return has_bit[static_cast<std::size_t>(row * width + column)] != 0 ? std::int8_t{0} : CodeGrid::k_unused;
  });
  return grid;
}

std::array<std::uint64_t, 4> four_turns(std::uint64_t code, const CodeGrid& grid) {
  std::array<std::uint64_t, 4> turns{code};
  for (std::size_t k = 1; k < 4; ++k) turns[k] = turned(turns[k - 1], grid);
  return turns;
}

}  // namespace limn::tracker
