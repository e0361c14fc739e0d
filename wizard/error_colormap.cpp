#include "wizard/error_colormap.h"

#include <algorithm>
#include <cmath>

#include "calib/judge/assess.h"

namespace limn::wizard {
namespace {

using Rgb = std::array<std::uint8_t, 3>;

constexpr Rgb k_green = {110, 211, 120}, k_amber = {245, 182, 66}, k_red = {255, 107, 97};

Rgb mixed(const Rgb& a, const Rgb& b, double share) {
  Rgb out{};
  for (std::size_t i = 0; i < 3; ++i)
    out[i] = static_cast<std::uint8_t>(std::lround(a[i] + std::clamp(share, 0.0, 1.0) * (b[i] - a[i])));
  return out;
}

}  // namespace

Rgb error_rgb(double mm) {
  const double fine = calib::k_fine_mm, good = calib::k_good_mm, usable = calib::k_usable_mm;
  return mm <= good ? mixed(k_green, k_amber, (mm - fine) / (good - fine))
                    : mixed(k_amber, k_red, (mm - good) / (usable - good));
}

}  // namespace limn::wizard
