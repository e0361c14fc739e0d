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

}  // namespace

double mean_relative(const float* fractions, std::size_t places, double limit) {
  double sum = 0;
  for (std::size_t i = 0; i < places; ++i) sum += relative(fractions[i], static_cast<float>(limit));
  return sum / static_cast<double>(places);
}

void QuadReader::fractions(const Places& places, Fractions* into) const {
  const std::span x = std::span(places.x).first(places.count), y = std::span(places.y).first(places.count);
  levels.between(x, y, into->data());
  to_fractions(dark, light, x.data(), y.data(), places.count, into->data());
}

}  // namespace limn::tracker::identity
