#pragma once

#include <optional>

#include "scene/scene.h"
#include "scene/staging.h"

namespace limn::apps {

/// What keys do, of a keyboard, a presentation clicker or a pedal. One slot is chosen at a time.
///   right, page down, n: next variant    left, page up, p: previous    tab: next slot
///   b, full stop: blackout    f: freeze    m: markers' states    s: save a look    l, k: next, previous look
///   o: what the screen shows    r: the part follows its marker again
///   a: pair the part with the marker that glows    v: the look before, and back    x: both, beside a line    g: grid
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
