#pragma once

#include <optional>

#include "scene/actions.h"
#include "scene/scene.h"

namespace limn::session {

/// Maps keys of a keyboard, a presentation clicker or a pedal to edits; the actions name their keys
/// (scene/actions.cpp). One slot is chosen at a time; tab chooses the next one.
class Keys {
 public:
  explicit Keys(const scene::Scene& scene);
  /// The edit for a key (GLFW's code); nullopt for tab and for keys without an action.
  std::optional<scene::Edit> edit_of(int key);
  /// The chosen slot's name; empty without slots.
  const std::string& slot() const { return slots_.empty() ? none_ : slots_[chosen_]; }

 private:
  std::vector<std::string> slots_;
  std::size_t chosen_ = 0;
  std::string none_;
};

}  // namespace limn::session
