// Keys trigger the actions that they belong to, for the chosen slot.
#include "session/requests/keys.h"

#include <gtest/gtest.h>

namespace limn::session {
namespace {

constexpr int k_escape = 256, k_tab = 258, k_right = 262, k_page_up = 266, k_f1 = 290;  // GLFW's

scene::Scene with_slots(const std::vector<std::string>& names) {
  scene::Scene scene;
  for (const std::string& name : names) {
    scene.slots.emplace_back();
    scene.slots.back().name = name;
  }
  return scene;
}

std::string text_of(const std::optional<scene::Edit>& edit) {
  return edit ? edit->action + "|" + edit->slot + "|" + edit->value : "nothing";
}

TEST(Keys, DoActionsToTheChosenSlot) {
  Keys keys(with_slots({"mirror", "grille"}));
  EXPECT_EQ(text_of(keys.edit_of(k_right)), "next_variant|mirror|");
  EXPECT_EQ(text_of(keys.edit_of('N')), "next_variant|mirror|");
  EXPECT_EQ(text_of(keys.edit_of(k_tab)), "nothing");
  EXPECT_EQ(text_of(keys.edit_of(k_page_up)), "previous_variant|grille|");
  EXPECT_EQ(text_of(keys.edit_of('R')), "release|grille|");
  EXPECT_EQ(text_of(keys.edit_of('A')), "pair|grille|");
  EXPECT_EQ(text_of(keys.edit_of('.')), "blackout||");
  EXPECT_EQ(text_of(keys.edit_of('O')), "screen||next");
  EXPECT_EQ(text_of(keys.edit_of(k_tab)), "nothing");
  EXPECT_EQ(text_of(keys.edit_of('P')), "previous_variant|mirror|");
  for (const int key : {0, -1, k_escape, k_f1, int{'n'}, int{'Z'}})
    EXPECT_EQ(text_of(keys.edit_of(key)), "nothing") << key;
}

TEST(Keys, WithoutSlotsDoWhatNeedsNone) {
  Keys keys(with_slots({}));
  for (const int key : {k_tab, k_right, int{'P'}, int{'R'}, int{'A'}})
    EXPECT_EQ(text_of(keys.edit_of(key)), "nothing") << key;
  EXPECT_EQ(text_of(keys.edit_of('F')), "freeze||");
  EXPECT_EQ(text_of(keys.edit_of('S')), "save_look||");
}

}  // namespace
}  // namespace limn::session
