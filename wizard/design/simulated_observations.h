#pragma once

#include "calib/observations.h"
#include "wizard/design/rig_description.h"

namespace limn::design {

/// Observations of the described rig during its calibration: board poses all over the volume, and the corners
/// and matches that its devices would find, with normal noise. The same description gives the same numbers.
calib::Observations simulated_observations(const DescribedRig& described);

}  // namespace limn::design
