#include "tracker/reading_choice.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tracker/simd.h"

namespace limn::tracker::identity {
namespace {

// The whole square, sampled at the same places for every pattern, whatever its cells, and smoothed as
// templates are.
class SeenSquare {
 public:
  /// `reach`: how far beyond the square it is sampled, too, as share of its side.
  SeenSquare(const QuadReader& reader, double limit, double reach);
  /// Correlation of the pattern with the square, -1 … 1.
  double correlation(const Pattern& pattern) const;

 private:
  static constexpr std::size_t k_places = 20;  // places along a side
  using Values = std::array<float, k_places * k_places>;
  double reach_;
  Values values_;

  double share(std::size_t place) const {
    return (1 + 2 * reach_) * (static_cast<double>(place) + 0.5) / k_places - reach_;
  }
  // Smooths and scales to zero mean and unit length.
  static void normalise(Values* values);
};

LIMN_SIMD float sum_of(const float* __restrict values, std::size_t count) {
  float sum = 0;
#pragma omp simd reduction(+ : sum)
  for (std::size_t i = 0; i < count; ++i) sum += values[i];
  return sum;
}

LIMN_SIMD float product_of(const float* a, const float* b, std::size_t count) {
  float sum = 0;
#pragma omp simd reduction(+ : sum)
  for (std::size_t i = 0; i < count; ++i) sum += a[i] * b[i];
  return sum;
}

void SeenSquare::normalise(Values* values) {
  Values scratch;
  smooth(*values, scratch, k_places);
  const float mean = sum_of(values->data(), values->size()) / (k_places * k_places);
  for (float& value : *values) value -= mean;
  const float scale = 1 / std::sqrt(1e-9f + product_of(values->data(), values->data(), values->size()));
  for (float& value : *values) value *= scale;
}

SeenSquare::SeenSquare(const QuadReader& reader, double limit, double reach) : reach_(reach) {
  Places places;
  for (std::size_t row = 0; row < k_places; ++row)
    for (std::size_t column = 0; column < k_places; ++column) places.add(share(column), share(row));
  Fractions fractions;
  reader.fractions(places, &fractions);
  for (std::size_t i = 0; i < values_.size(); ++i)
    values_[i] = relative(fractions[i], static_cast<float>(limit));
  normalise(&values_);
}

// A place on the border between two cells counts half of each, so that the value does not depend on the
// square's rotation.
double SeenSquare::correlation(const Pattern& pattern) const {
  constexpr double k_beside = 1e-6;
  std::array<int, k_places> before, after;  // the cells on both sides of each place
  for (std::size_t i = 0; i < k_places; ++i) {
    before[i] = pattern.cell_at(share(i) - k_beside);
    after[i] = pattern.cell_at(share(i) + k_beside);
  }
  Values shown;
  for (std::size_t row = 0; row < k_places; ++row) {
    float* const into = &shown[row * k_places];
    if (row > 0 && before[row] == after[row - 1] && before[row] == before[row - 1] &&
        after[row] == before[row]) {
      std::copy_n(into - k_places, k_places, into);
      continue;
    }
    for (std::size_t column = 0; column < k_places; ++column) {
      const auto of_row = [&](int cell) {
        return 0.5F * (pattern.value(cell, before[column]) + pattern.value(cell, after[column]));
      };
      const float upper = of_row(before[row]);
      into[column] = after[row] == before[row] ? upper : 0.5F * (upper + of_row(after[row]));
    }
  }
  normalise(&shown);
  return product_of(shown.data(), values_.data(), values_.size());
}

// Log likelihood ratio of a pattern and none, for `k_independent` values in Gaussian noise whose variance is
// estimated from the residual. The floor is the share that geometry and light leave unexplained at best.
constexpr double k_independent = 60;
constexpr double k_residual_floor = 0.03;
double evidence(double correlation) {
  const double c = std::clamp(correlation, 0.0, 1.0);
  return 0.5 * k_independent * std::log((1 + k_residual_floor) / (1 - c * c + k_residual_floor));
}

// An unknown pattern is assumed to explain the square as well as a pattern with this correlation.
constexpr double k_unknown_correlation = 0.75;

// By how much better (in nats) than the reading a code in another grid must explain the square to be as
// likely: its cells are free, so blur and noise fit them a little better than any marker's.
constexpr double k_free_cells = 25;
constexpr double k_free_barcode = 3;  // the same for the few cells of a barcode
// A reading that explains the square as well as this is not one in a wrong grid.
constexpr double k_clear_correlation = 0.92;

// Only cells that are not blurred into each other count, because free cells explain blur better than a code
// does.
double least_cell_px(const QuadReader& reader) {
  constexpr double k_least_px = 3, k_least_sigmas = 3;
  return std::max(k_least_px, k_least_sigmas * reader.blur_px);
}

// What the square shows in a grid whose border is `ring` cells of `values` wide, but `border` cells of the
// marker.
Pattern shown_in(const Grid& values, int width, int ring, double border) {
  const int cells = width - 2 * ring;
  Pattern pattern{border, static_cast<double>(cells)};
  for (int row = ring; row < width - ring; ++row)
    for (int column = ring; column < width - ring; ++column) {
      const bool is_white = values[static_cast<std::size_t>(row * width + column)] > 0;
      pattern.code = (pattern.code << 1) | std::uint64_t{is_white};
    }
  return pattern;
}

bool is_barcode(const Pattern& pattern) {
  return !pattern.drawn && !pattern.grid && pattern.border == 0.5 * pattern.cells;
}

// The largest correlation of what the square shows in the grids of barcodes other than `best`.
double most_in_other_barcodes(const QuadReader& reader, const SeenSquare& seen, const Pattern& best) {
  double most = 0;
  CellSamples samples;
  for (const int cells : {3, 4, 5}) {
    const double border = 0.5 * cells;
    if (cells == best.cells || reader.side_px < 2 * cells * least_cell_px(reader)) continue;
    reader.read_inside(cells, border, &samples);
    most = std::max(most, seen.correlation(shown_in(grid_of(samples, k_middle), cells + 2, 1, border)));
  }
  return most;
}

// The largest correlation of what the square shows in grids of 3 x 3 to 7 x 7 cells, in borders of one and
// two cells: a marker of a family that is not searched for looks like one of these. Only cells that are not
// blurred into each other count, because free cells explain blur better than a code does. A template is not
// compared, because cells of a grid resemble its drawing.
double most_in_other_grids(const QuadReader& reader, const SeenSquare& seen, const Pattern& best) {
  constexpr int k_least_cells = 3, k_most_cells = 7;
  double most = 0;
  if (best.drawn) return most;
  const double least_px = least_cell_px(reader);
  CellSamples samples;
  for (int width = k_least_cells + 2; width <= k_most_cells + 4 && reader.side_px >= width * least_px;
       ++width) {
    reader.read(width, 0, &samples);
    const Grid values = grid_of(samples, k_middle);
    for (const int border : {1, 2}) {
      const int cells = width - 2 * border;
      const bool is_own = !best.grid && cells == best.cells && border == best.border;
      if (cells >= k_least_cells && cells <= k_most_cells && !is_own)
        most = std::max(most, seen.correlation(shown_in(values, width, border, border)));
    }
  }
  return most;
}

// How much likelier than a reading with this correlation it is that the square shows cells of another grid.
double odds_of_other_grid(const QuadReader& reader,
                          const SeenSquare& seen,
                          const Pattern& best,
                          double correlation) {
  const double grid = correlation < k_clear_correlation ? most_in_other_grids(reader, seen, best) : 0;
  const double barcode = is_barcode(best) ? most_in_other_barcodes(reader, seen, best) : 0;
  return std::exp(evidence(grid) - k_free_cells - evidence(correlation)) +
         std::exp(evidence(barcode) - k_free_barcode - evidence(correlation));
}

}  // namespace

std::optional<Identity> choose_reading(const QuadReader& reader, const Readings& readings) {
  if (readings.accepted.empty()) return std::nullopt;
  if (readings.certainty == Certainty::any) return readings.accepted.front().identity;
  double reach = 0;
  for (const Readings::Accepted& reading : readings.accepted)
    reach = std::max(reach, reading.pattern.reach());
  std::array<std::optional<SeenSquare>, k_limits.size()> seen_by_limit;
  const auto seen_at = [&](double limit) -> const SeenSquare& {
    const auto i =
        static_cast<std::size_t>(std::find(k_limits.begin(), k_limits.end(), limit) - k_limits.begin());
    if (!seen_by_limit[i]) seen_by_limit[i].emplace(reader, limit, reach);
    return *seen_by_limit[i];
  };
  const Readings::Accepted* best = nullptr;
  double most = -2;
  for (const Readings::Accepted& reading : readings.accepted) {
    const double alike = seen_at(reading.limit).correlation(reading.pattern);
    if (alike <= most) continue;
    most = alike;
    best = &reading;
  }
  const SeenSquare& seen = seen_at(best->limit);
  double next = 0;
  const auto compete = [&](const Pattern& other) {
    if (other != best->pattern) next = std::max(next, seen.correlation(other));
  };
  for (const Readings::Accepted& reading : readings.accepted) compete(reading.pattern);
  for (const Pattern& other : readings.others) compete(other);
  const double another = std::exp(evidence(next) - evidence(most));
  const double unknown = best->random_hit * std::exp(evidence(k_unknown_correlation) - evidence(most));
  Identity identity = best->identity;
  identity.score = 1 / (1 + another + odds_of_other_grid(reader, seen, best->pattern, most) + unknown);
  if (identity.score < k_min_confidence) return std::nullopt;
  return identity;
}

}  // namespace limn::tracker::identity
