#pragma once

#include <string>

#include "wizard/design/rig_design.h"

namespace limn::design {

/// The text that `limn plan` prints.
std::string design_table(const PredictedAccuracy& predicted_accuracy, const DescribedRig& described);

/// The same as JSON (plan.json), without a newline at its end.
std::string design_json(const PredictedAccuracy& predicted_accuracy);

}  // namespace limn::design
