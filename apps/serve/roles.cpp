#include "apps/serve/roles.h"

#include <nlohmann/json.hpp>

namespace limn::apps {
namespace {

const char* name_of(scene::Takes takes) {
  switch (takes) {
    case scene::Takes::nothing:
      return "nothing";
    case scene::Takes::text:
      return "text";
    case scene::Takes::maybe_text:
      return "maybe_text";
    case scene::Takes::number:
      return "number";
    case scene::Takes::millimetres:
      return "millimetres";
    case scene::Takes::pose:
      return "pose";
    case scene::Takes::on_off:
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
                   {"takes", name_of(action.takes)},
                   {"value", action.value},
                   {"what", action.what},
                   {"role", name_of(action.role)}});
  return all.dump();
}

}  // namespace limn::apps
