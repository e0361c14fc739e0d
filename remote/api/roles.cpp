#include "remote/api/roles.h"

#include <nlohmann/json.hpp>

#include "core/json_text.h"

namespace limn::remote {
namespace {

const char* name_of(scene::ArgumentKind argument_kind) {
  switch (argument_kind) {
    case scene::ArgumentKind::nothing:
      return "nothing";
    case scene::ArgumentKind::text:
      return "text";
    case scene::ArgumentKind::maybe_text:
      return "maybe_text";
    case scene::ArgumentKind::number:
      return "number";
    case scene::ArgumentKind::millimetres:
      return "millimetres";
    case scene::ArgumentKind::pose:
      return "pose";
    case scene::ArgumentKind::on_off:
      return "on_off";
  }
  LIMN_CHECK(false);
}

}  // namespace

Role role_for(const std::string& action) {
  const scene::Action* found = scene::find_action(action);
  return found ? found->role : Role::operate;
}

std::string actions_json() {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const scene::Action& action : scene::actions())
    all.push_back({{"name", action.name},
                   {"of_slot", action.of_slot},
                   {"takes", name_of(action.argument_kind)},
                   {"value", action.value},
                   {"what", action.what},
                   {"role", name_of(action.role)}});
  return json_text(all);
}

}  // namespace limn::remote
