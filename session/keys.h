#pragma once

#include <optional>

#include "scene/actions.h"
#include "scene/scene.h"

namespace limn::apps {

/// What keys do, of a keyboard, a presentation clicker or a pedal: the actions that have them
/// (scene/actions.cpp). One slot is chosen at a time; tab chooses the next one.
class Keys {
 public:
  explicit Keys(const scene::Scene& scene);
  /// The edit of a key (GLFW's codes); nullopt for a key that changes nothing shown.
  std::optional<scene::Edit> edit_of(int key);
  /// The chosen slot's name; empty without slots.
  const std::string& slot() const { return slots_.empty() ? none_ : slots_[chosen_]; }

 private:
  std::vector<std::string> slots_;
  std::size_t chosen_ = 0;
  std::string none_;
};

}  // namespace limn::apps
