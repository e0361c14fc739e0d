#pragma once

#include <string>

#include "scene/actions.h"

namespace limn::remote {

using scene::Role;

/// The role that an action needs, by its name; `operate` for a name that is not in scene::actions().
Role role_for(const std::string& action);

/// The table of actions as JSON, the answer to GET /api/actions.
std::string actions_json();

}  // namespace limn::remote
