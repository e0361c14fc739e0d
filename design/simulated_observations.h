#pragma once

#include "calib/observations.h"
#include "design/rig_description.h"

namespace limn::apps {

/// What the described rig would observe while it is calibrated: board placements all over the volume, what
/// cameras and projectors would see of them with normal noise. The same description gives the same numbers.
calib::Observations simulated_observations(const DescribedRig& described);

}  // namespace limn::apps
