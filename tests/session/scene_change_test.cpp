#include "session/scene_change.h"

#include <filesystem>

#include "core/file.h"
#include "core/names.h"
#include "scene/scene.h"
#include "tests/support/matchers.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;

LoadedScene loaded_again(const fs::path& folder) {
  LoadedScene loaded;
  auto scene = scene::load_scene(folder, &loaded.skipped_variants, scene::EmptySlots::kept);
  EXPECT_TRUE(scene) << scene.message();
  loaded.scene = std::move(scene).value();
  return loaded;
}

// One of three variants of the mirror and the only one of the trim are damaged while a new one is added.
TEST(SceneChange, DamagedPartsStayAsTheyWereAndOthersAreLoaded) {
  const fs::path folder = test::test_folder() / "door";
  fs::copy(fs::path(LIMN_SOURCE_DIR) / "config/scenes/door", folder);
  const scene::Scene now = scene::load_scene(folder).value();
  for (const char* name : {"mirror-sport.glb", "trim-line.glb"}) fs::resize_file(folder / name, 1000);
  fs::create_directories(folder / "slots/mirror");
  ASSERT_TRUE(write_file(folder / "slots/mirror/new.obj", "v 0 0 0\nv 149 0 0\nv 0 60 0\nf 1 2 3\n"));
  ASSERT_TRUE(write_file(folder / "slots/mirror/never.stl", "solid\n"));
  LoadedScene loaded = loaded_again(folder);
  const std::vector<scene::SkippedVariant> kept = keep_old_variants(now, &loaded);
  ASSERT_EQ(kept.size(), 2U);
  EXPECT_NE(kept[0].why.find("mirror-sport.glb"), std::string::npos) << kept[0].why;
  ASSERT_EQ(loaded.skipped_variants.size(), 1U);  // it never was a part
  EXPECT_EQ(loaded.skipped_variants[0].variant, "never");
  EXPECT_TRUE(check_same_markers(now, loaded.scene));
  ASSERT_EQ(loaded.scene.slots.size(), now.slots.size());
  for (const scene::Slot& slot : now.slots) {
    const scene::Slot& after = *loaded.scene.find_slot(slot.name);
    ASSERT_EQ(after.variants.size(), slot.variants.size() + (slot.name == "mirror" ? 1 : 0)) << slot.name;
    for (std::size_t i = 0; i < slot.variants.size(); ++i) {
      EXPECT_EQ(after.variants[i].name, slot.variants[i].name);
      EXPECT_EQ(after.variants[i].mesh.positions, slot.variants[i].mesh.positions);
    }
  }
  EXPECT_EQ(loaded.scene.find_slot("mirror")->variants.back().name, "new");
}

}  // namespace
}  // namespace limn::session
