#pragma once

#include <string>

#include "wizard/design/rig_design.h"

namespace limn::design {

/// The page plan.html of `limn plan`: the rig from above and from the side to scale, the predicted errors,
/// the advice and the table. It needs no other file.
std::string plan_page(const DescribedRig& described, const PredictedAccuracy& predicted_accuracy);

}  // namespace limn::design
