#pragma once

#include <cmath>

namespace limn::calib {

/// To a ten-thousandth, as the files of a rig say numbers: more digits are noise, and hard to read.
inline double rounded(double v) { return std::isfinite(v) ? std::round(v * 1e4) / 1e4 : v; }

}  // namespace limn::calib
