#pragma once

#include <string>
#include <vector>

#include "design/rig_design.h"

namespace limn::apps {

/// What limits the described rig and what to do about it, a sentence each, most hurtful first; empty:
/// nothing.
std::vector<std::string> design_advice(const PredictedAccuracy& predicted_accuracy,
                                       const DescribedRig& described);

}  // namespace limn::apps
