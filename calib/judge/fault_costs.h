#pragma once

#include <vector>

#include "calib/judge/faults.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// Adds to the evidence of defocus, shake and flicker what they cost in mm on the surface. defocus: the
/// predicted error (`predicted_mm`, of the worst projector) is proportional to the scatter of the edges,
/// which is proportional to their blur. shake and flicker are taken out; left in, each pose would have a
/// displacement of its own, and their mean would be left in the rig.
void state_costs(const Observations& observations,
                 const Solution& solution,
                 double predicted_mm,
                 std::vector<Fault>* faults);

}  // namespace limn::calib
