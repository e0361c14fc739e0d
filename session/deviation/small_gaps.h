#pragma once

#include "calib/surface/deviation.h"

namespace limn::session {

/// The comparison with values in its small gaps, which otherwise are dark specks in light: at most 60
/// connected points that are not measured, because the scan lacks single pixels there. A gap takes the mean
/// of what is around it, continued smoothly, and the largest standard deviation around it. It stays a gap
/// where the values around it differ by more than the tolerance.
calib::Deviation with_small_gaps_bridged(calib::Deviation comparison);

}  // namespace limn::session
