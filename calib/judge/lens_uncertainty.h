#pragma once

#include <cstddef>

#include "calib/solve.h"

namespace limn::calib {

/// Standard deviation (px, root of the sum of both axes' variances) of where a camera's lens puts a
/// direction: the largest over nine tenths of a grid of places in its image, from the solution's covariance
/// of the lens. A shift of all places that a rotation of the camera explains does not count, because every
/// pose that is measured later turns with it (as in mrcal's projection uncertainty). Infinite when a place
/// has no direction.
double lens_stddev_px(const Solution& solution, std::size_t camera);

}  // namespace limn::calib
