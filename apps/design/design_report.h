#pragma once

#include <string>

#include "apps/design/rig_design.h"

namespace limn::apps {

/// What `limn plan` prints: the table.
std::string design_table(const Foreseen& foreseen, const Described& described);

/// The same as JSON (plan.json), without a newline at its end.
std::string design_json(const Foreseen& foreseen);

}  // namespace limn::apps
