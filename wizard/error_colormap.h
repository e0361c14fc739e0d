#pragma once

#include <array>
#include <cstdint>

namespace limn::apps {

/// Red, green, blue for a predicted error: green up to a quarter of a millimetre (calib::k_fine_mm), amber at
/// one (k_good_mm), red from three on (k_usable_mm).
std::array<std::uint8_t, 3> error_rgb(double mm);

}  // namespace limn::apps
