#include "apps/live/keys.h"

namespace limn::apps {
namespace {

// GLFW's codes of keys that are no characters.
constexpr int k_tab = 258, k_right = 262, k_left = 263, k_page_up = 266, k_page_down = 267;

}  // namespace

Keys::Keys(const scene::Scene& scene) {
  for (const scene::Slot& slot : scene.slots) slots_.push_back(slot.name);
}

std::optional<scene::Edit> Keys::edit_of(int key) {
  const auto of_slot = [&](const char* action) -> std::optional<scene::Edit> {
    if (slots_.empty()) return std::nullopt;
    return scene::Edit{action, slot(), ""};
  };
  switch (key) {
    case k_tab:
      if (!slots_.empty()) chosen_ = (chosen_ + 1) % slots_.size();
      return std::nullopt;
    case k_right:
    case k_page_down:
    case 'N':
      return of_slot("next_variant");
    case k_left:
    case k_page_up:
    case 'P':
      return of_slot("previous_variant");
    case 'R':
      return of_slot("release");
    case 'A':
      return of_slot("pair");
    case 'B':
    case '.':
      return scene::Edit{"blackout", "", ""};
    case 'F':
      return scene::Edit{"freeze", "", ""};
    case 'M':
      return scene::Edit{"marker_states", "", ""};
    case 'S':
      return scene::Edit{"save_look", "", ""};
    case 'L':
      return scene::Edit{"next_look", "", ""};
    case 'K':
      return scene::Edit{"previous_look", "", ""};
    case 'V':
      return scene::Edit{"flip", "", ""};
    case 'X':
      return scene::Edit{"split", "", ""};
    case 'G':
      return scene::Edit{"grid", "", ""};
    case 'O':
      return scene::Edit{"screen", "", "next"};
    default:
      return std::nullopt;
  }
}

}  // namespace limn::apps
