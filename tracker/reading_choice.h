#pragma once

#include <cstdint>
#include <memory_resource>
#include <optional>
#include <utility>
#include <vector>

#include "tracker/family.h"
#include "tracker/identify.h"
#include "tracker/quad_reader.h"

/// Which of several readings of a quad is right, and with what probability. For tracker/identify.cpp.
namespace limn::tracker::identity {

// The pattern that a quad would show, in the quad's rotation.
struct Pattern {
  double border = 0, cells = 0;  // width of the border, cells along a side
  std::uint64_t code = 0;
  const TemplatePattern* drawn = nullptr;  // a template instead of a code
  std::size_t rotation = 0;                // the template's
  const CodeGrid* grid = nullptr;          // grid of a code with cells around its square

  bool operator==(const Pattern&) const = default;

  static constexpr int k_in_border = -1, k_beside = -2;
  // The row (or column) of cells at a share of the side, or one of the above.
  int cell_at(double share) const {
    if (grid) {
      const double place = share * grid->side() + grid->rings;
      return place < 0 || place >= grid->width ? k_beside : static_cast<int>(place);
    }
    if (share < 0 || share > 1) return k_beside;
    const double place = share * (cells + 2 * border) - border;
    return place < 0 || place >= cells ? k_in_border : static_cast<int>(place);
  }
  // Value of a cell, -1 black … 1 white, 0 unknown.
  float value(int row, int column) const {
    if (row == k_beside || column == k_beside) return grid ? 0 : 1;
    if (row < 0 || column < 0) return -1;
    if (grid) return value_of(grid->at(row, column));
    const int columns = static_cast<int>(cells);
    if (!drawn) return (code >> (columns * columns - 1 - (row * columns + column))) & 1 ? 1 : -1;
    for (std::size_t k = 0; k < rotation; ++k) row = columns - 1 - std::exchange(column, row);
    return static_cast<float>(drawn->grey[static_cast<std::size_t>(row * columns + column)] / 127.5 - 1);
  }
  // How far it reaches beyond the square, as share of the side.
  double reach() const { return grid ? static_cast<double>(grid->rings) / grid->side() : 0; }

 private:
  float value_of(std::int8_t cell) const {
    if (cell >= 0) return (code >> cell) & 1 ? 1.0F : -1.0F;
    return cell == CodeGrid::k_dark ? -1.0F : cell == CodeGrid::k_light ? 1.0F : 0.0F;
  }
};

inline Pattern pattern_of(const CodeFamily& family, std::uint64_t code) {
  const CodeGrid* const grid = family.grid.rings > 0 ? &family.grid : nullptr;
  return {family.border_cells, static_cast<double>(family.cells), code, nullptr, 0, grid};
}
inline Pattern pattern_of(const TemplatePattern& drawn, std::size_t rotation) {
  const double border = drawn.size * drawn.border / (1 - 2 * drawn.border);
  return {border, static_cast<double>(drawn.size), 0, &drawn, rotation};
}

// The patterns accepted in a quad, and rival patterns that it might show instead.
struct Readings {
  struct Accepted {
    Identity identity;
    Pattern pattern;
    double limit = k_middle;  // the one between black and white
    double random_hit = 1;    // probability that random cells are accepted as some marker of the family
  };
  Certainty certainty = Certainty::weighed;
  std::pmr::vector<Accepted> accepted;
  std::pmr::vector<Pattern> others;

  Readings(Certainty wanted, std::pmr::memory_resource* memory)
      : certainty(wanted), accepted(memory), others(memory) {}
};

/// The likeliest reading, with the probability that it is right; nullopt when that is below k_min_confidence.
/// With Certainty::any it is the first reading, without a probability.
std::optional<Identity> choose_reading(const QuadReader& reader, const Readings& readings);

}  // namespace limn::tracker::identity
