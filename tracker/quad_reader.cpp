#include "tracker/quad_reader.h"

#include "tracker/simd.h"

namespace limn::tracker::identity {
namespace {

// Replaces levels by fractions of the way from dark to light at their places.
LIMN_SIMD void to_fractions(const Plane& dark,
                            const Plane& light,
                            const float* __restrict x,
                            const float* __restrict y,
                            std::size_t count,
                            float* __restrict levels) {
  for (std::size_t i = 0; i < count; ++i) {
    const float low = dark.a + dark.b * x[i] + dark.c * y[i];
    const float apart = light.a + light.b * x[i] + light.c * y[i] - low;
    const float range = apart > 2 ? apart : 2;
    levels[i] = (levels[i] - low) / range;
  }
}

constexpr double k_sharpening = 0.25;  // weight of the Laplacian

// Removes blur from the four neighbours. Outside of the marker is white, or unknown where cells lie around
// the square.
void sharpen(int cells, bool is_white_outside, Grid* grid) {
  const Grid before = *grid;
  const auto at = [&](int row, int column) { return before[static_cast<std::size_t>(row * cells + column)]; };
  const auto value = [&](int row, int column) {
    const bool outside = row < 0 || column < 0 || row >= cells || column >= cells;
    if (!outside) return at(row, column);
    return is_white_outside ? 1.0 : at(std::clamp(row, 0, cells - 1), std::clamp(column, 0, cells - 1));
  };
  for (int row = 0; row < cells; ++row)
    for (int column = 0; column < cells; ++column) {
      const double here = value(row, column);
      const double around =
          value(row - 1, column) + value(row + 1, column) + value(row, column - 1) + value(row, column + 1);
      (*grid)[static_cast<std::size_t>(row * cells + column)] = here + k_sharpening * (4 * here - around);
    }
}

}  // namespace

double mean_relative(const float* fractions, std::size_t places, double limit) {
  double sum = 0;
  for (std::size_t i = 0; i < places; ++i) sum += relative(fractions[i], static_cast<float>(limit));
  return sum / static_cast<double>(places);
}

Grid grid_of(const CellSamples& samples, double limit) {
  Grid grid;
  const auto count = static_cast<std::size_t>(samples.cells * samples.cells);
  for (std::size_t i = 0; i < count; ++i)
    grid[i] = mean_relative(&samples.fraction[i * samples.places()], samples.places(), limit);
  if (!samples.several) sharpen(samples.cells, samples.rings == 0, &grid);
  return grid;
}

void QuadReader::fractions(const Places& places, Fractions* into) const {
  const std::span x = std::span(places.x).first(places.count), y = std::span(places.y).first(places.count);
  levels.between(x, y, into->data());
  to_fractions(dark, light, x.data(), y.data(), places.count, into->data());
}

}  // namespace limn::tracker::identity
