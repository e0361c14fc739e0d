#pragma once

#include <string>

#include "scene/actions.h"

namespace limn::remote {

using scene::Role;

/// Who may do an action, by its name; `operate` for one that is not in scene::actions().
Role role_for(const std::string& action);

/// The table of actions as GET /api/actions tells it: JSON.
std::string actions_json();

}  // namespace limn::remote
