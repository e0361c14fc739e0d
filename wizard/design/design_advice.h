#pragma once

#include <string>
#include <vector>

#include "wizard/design/rig_design.h"

namespace limn::design {

/// What limits the described rig and what to do about it, one sentence for each, the most important first;
/// empty: nothing does.
std::vector<std::string> design_advice(const PredictedAccuracy& predicted_accuracy,
                                       const DescribedRig& described);

}  // namespace limn::design
