#pragma once

#include <vector>

#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// What the noise of the observations lets light miss, for each projector: 95 % error on the surface, mm, of
/// a point on a rigid thing whose pose is measured by the same camera. Such a thing (as large as the board)
/// is put wherever the board was, and there moved by 150 mm and turned by 40 degrees both ways; its pose
/// follows the camera's errors (linearised), so that what both share cancels. 95 % of the points' own 95 %
/// errors are at most this. Infinite when a projector reaches none of them. Model errors are not in it: read
/// it beside the held-out error.
std::vector<double> propagated_error_mm(const Observations& observations, const Solution& solution);

}  // namespace limn::calib
