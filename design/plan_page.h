#pragma once

#include <string>

#include "design/rig_design.h"

namespace limn::apps {

/// plan.html of `limn plan`: self-contained, the rig from above and from the side to scale, how far light may
/// be off, the table and what limits.
std::string plan_page(const DescribedRig& described, const PredictedAccuracy& predicted_accuracy);

}  // namespace limn::apps
