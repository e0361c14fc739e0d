#pragma once

#include <string>

#include "scene/staging.h"

namespace limn::apps {

/// What a guest of the remote may do; each may do what those before it may (docs/remote.md).
enum class Role { look, work, operate };

/// "look", "work", "operate".
const std::string& name_of(Role role);

/// Who may do an action of scene::actions(); `operate` for an action that this table does not know.
Role role_for(const std::string& action);

/// The table of actions as GET /api/actions tells it: JSON.
std::string actions_json();

}  // namespace limn::apps
