#include "session/requests/keys.h"

#include <algorithm>

namespace limn::session {

Keys::Keys(const scene::Scene& scene) {
  for (const scene::Slot& slot : scene.slots) slots_.push_back(slot.name);
}

std::optional<scene::Edit> Keys::edit_of(int key) {
  const scene::Key pressed{key};
  if (pressed == scene::Key::none) return std::nullopt;
  if (pressed == scene::Key::tab) {
    if (!slots_.empty()) chosen_ = (chosen_ + 1) % slots_.size();
    return std::nullopt;
  }
  for (const scene::Action& action : scene::actions()) {
    if (std::find(action.keys.begin(), action.keys.end(), pressed) == action.keys.end()) continue;
    if (action.of_slot && slots_.empty()) return std::nullopt;
    return scene::make_edit(action.id, action.of_slot ? slot() : "", std::string(action.value_of_keys));
  }
  return std::nullopt;
}

}  // namespace limn::session
