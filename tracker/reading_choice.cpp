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
  SeenSquare(const QuadReader& reader, double limit);
  /// Correlation of the pattern with the square, -1 … 1.
  double correlation(const Pattern& pattern) const;

 private:
  static constexpr std::size_t k_places = 20;  // places along a side
  using Values = std::array<float, k_places * k_places>;
  Values values_;

  static double share(std::size_t place) { return (static_cast<double>(place) + 0.5) / k_places; }
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

SeenSquare::SeenSquare(const QuadReader& reader, double limit) {
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

}  // namespace

std::optional<Identity> choose_reading(const QuadReader& reader, const Readings& readings) {
  if (readings.accepted.empty()) return std::nullopt;
  if (readings.certainty == Certainty::any) return readings.accepted.front().identity;
  std::array<std::optional<SeenSquare>, k_limits.size()> seen_by_limit;
  const auto seen_at = [&](double limit) -> const SeenSquare& {
    const auto i =
        static_cast<std::size_t>(std::find(k_limits.begin(), k_limits.end(), limit) - k_limits.begin());
    if (!seen_by_limit[i]) seen_by_limit[i].emplace(reader, limit);
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
  identity.score = 1 / (1 + another + unknown);
  if (identity.score < k_min_confidence) return std::nullopt;
  return identity;
}

}  // namespace limn::tracker::identity
