#pragma once

#include <cmath>

namespace limn::calib {

/// Rounds to a ten-thousandth, as in all files of a rig: more digits are noise, and hard to read.
inline double rounded(double v) { return std::isfinite(v) ? std::round(v * 1e4) / 1e4 : v; }

}  // namespace limn::calib
