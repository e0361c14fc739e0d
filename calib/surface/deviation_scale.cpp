#include "calib/surface/deviation_scale.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

namespace limn::calib {
namespace {

// The inner limit of a band on either side, in tolerances.
double inner_limit(int side_band) { return std::exp2(side_band - 1); }

}  // namespace

int deviation_band(double deviation_m, double tolerance_m) {
  int band = 0;
  while (band < k_deviation_bands && std::abs(deviation_m) > inner_limit(band + 1) * tolerance_m) ++band;
  return deviation_m < 0 ? -band : band;
}

std::array<std::uint8_t, 3> band_colour_rgb(int band) {
  constexpr std::array<std::array<std::uint8_t, 3>, 2 * k_deviation_bands + 1> k_colours = {{{94, 53, 177},
                                                                                             {38, 99, 200},
                                                                                             {79, 184, 222},
                                                                                             {76, 165, 92},
                                                                                             {247, 203, 52},
                                                                                             {240, 128, 42},
                                                                                             {200, 34, 40}}};
  return k_colours[static_cast<std::size_t>(band + k_deviation_bands)];
}

std::string band_text(int band, double tolerance_m) {
  const double mm = 1e3 * tolerance_m;
  const int size = std::abs(band);
  if (size == 0) return fmt::format("-{0:g} to {0:g} mm", mm);
  const double inner = inner_limit(size) * mm, outer = 2 * inner;
  if (size == k_deviation_bands)
    return band > 0 ? fmt::format("over {:g} mm", inner) : fmt::format("below -{:g} mm", inner);
  return band > 0 ? fmt::format("{:g} to {:g} mm", inner, outer)
                  : fmt::format("-{:g} to -{:g} mm", outer, inner);
}

}  // namespace limn::calib
