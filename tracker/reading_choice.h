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

  bool operator==(const Pattern&) const = default;

  // The row (or column) of cells at a share of the side; -1 in the border.
  int cell_at(double share) const {
    const double place = share * (cells + 2 * border) - border;
    return place < 0 || place >= cells ? -1 : static_cast<int>(place);
  }
  // Value of a cell, -1 black … 1 white.
  float value(int row, int column) const {
    if (row < 0 || column < 0) return -1;
    const int columns = static_cast<int>(cells);
    if (!drawn) return (code >> (columns * columns - 1 - (row * columns + column))) & 1 ? 1 : -1;
    for (std::size_t k = 0; k < rotation; ++k) row = columns - 1 - std::exchange(column, row);
    return static_cast<float>(drawn->grey[static_cast<std::size_t>(row * columns + column)] / 127.5 - 1);
  }
};

inline Pattern pattern_of(const CodeFamily& family, std::uint64_t code) {
  return {family.border_cells, static_cast<double>(family.cells), code, nullptr, 0};
}
inline Pattern pattern_of(const TemplatePattern& drawn, std::size_t rotation) {
  return {0.5 * drawn.size, static_cast<double>(drawn.size), 0, &drawn, rotation};
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
