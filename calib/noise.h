#pragma once

#include <cmath>

namespace limn::calib {

/// The scatter of one kind of observation, one coordinate. Each observation states its own standard
/// deviation; the residuals show what is added to all of them (`common_px`), or by which factor the stated
/// ones are too large (`scale`, at most 1).
struct NoiseLevel {
  double common_px = 0.2;
  double scale = 1;
  /// Standard deviation of an observation that states `own_px`, px.
  double total(double own_px) const { return std::hypot(scale * own_px, common_px); }
};

/// The noise levels of all kinds of observations.
struct Noise {
  NoiseLevel corner = {}, match = {}, tie_point = {};
};

}  // namespace limn::calib
