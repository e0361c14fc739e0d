#include "apps/serve/roles.h"

#include <array>
#include <nlohmann/json.hpp>
#include <set>

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

const std::string& name_of(Role role) {
  static const std::array<std::string, 3> names = {"look", "work", "operate"};
  return names[static_cast<std::size_t>(role)];
}

Role role_for(const std::string& action) {
  static const std::set<std::string> work = {
      "next_variant", "previous_variant", "choose_variant", "nudge",  "release", "save_look",
      "restore_look", "next_look",        "previous_look",  "flip",   "split",   "split_at",
      "delete_look",  "undelete_look",    "blackout",       "freeze", "grid",    "viewer",
      "place",        "material",         "light"};
  return work.contains(action) ? Role::work : Role::operate;
}

std::string actions_json() {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (const scene::Action& action : scene::actions())
    all.push_back({{"name", action.name},
                   {"of_slot", action.of_slot},
                   {"takes", name_of(action.takes)},
                   {"value", action.value},
                   {"what", action.what},
                   {"role", name_of(role_for(action.name))}});
  return all.dump();
}

}  // namespace limn::apps
