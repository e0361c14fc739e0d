#pragma once

#include <array>
#include <cstdint>

namespace limn::wizard {

/// Red, green and blue for a predicted error: green up to 0.25 mm (calib::k_fine_mm), amber at 1 mm
/// (calib::k_good_mm), red from 3 mm (calib::k_usable_mm).
std::array<std::uint8_t, 3> error_rgb(double mm);

}  // namespace limn::wizard
