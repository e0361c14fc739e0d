#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::test {

/// A car of 4.2 x 1.4 m in two projectors' light (1920 x 1200, 2.4 mm a pixel), with two cameras that each
/// see half of it, so that none of the 20 boards is seen by both. Ray-traced captures with the cameras at
/// half size are solved as limn solve does it, with and without a capture of the car itself and its markers,
/// and judged over the car's length. Captures are kept in `folder`.
Status bench_car(const std::filesystem::path& folder);

/// The same captures, enlarged to cameras of 2448 x 2048 and 4096 x 3000: peak memory and CPU time of the
/// solve, and the CPU time of reading the same images with OpenCV; also at half size, for how the time grows.
/// Needs the captures of bench_car() and 15 GB of disk.
Status bench_car_cost(const std::filesystem::path& folder);

}  // namespace limn::test
