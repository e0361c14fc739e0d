#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace limn::calib {

/// The colours of a deviation from the CAD: bands with steps at one, two and four times the tolerance, on
/// both sides. Inside the tolerance it is green; proud of the CAD (positive) yellow, orange, red; shy of it
/// (negative) light blue, blue, violet.

/// The number of bands on each side, without the one inside the tolerance.
constexpr int k_deviation_bands = 3;

/// The band of a deviation: 0 within the tolerance (its limit belongs to it), 1 to 3 proud, -1 to -3 shy.
int deviation_band(double deviation_m, double tolerance_m);

/// Its colour (sRGB).
std::array<std::uint8_t, 3> band_colour_rgb(int band);

/// The colour of what was not measured (sRGB).
constexpr std::array<std::uint8_t, 3> k_not_measured_rgb = {138, 141, 146};

/// Its limits as text: "0.5 to 1 mm", "over 2 mm", "-1 to -0.5 mm".
std::string band_text(int band, double tolerance_m);

}  // namespace limn::calib
