// Files that change while a session runs, some of which take long to read.
#include "session/scene_watch.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

#include "core/file.h"
#include "scene/files/cad_program.h"
#include "tests/exchange/cad_folder.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

class AWatchedScene : public test::Cad {
 protected:
  void SetUp() override {
    test::Cad::SetUp();
    fs::create_directories(folder / "slots" / "mirror");
    write("a.obj", "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n");
    write("scene.json",
          R"({"schema": "limn.scene/1", "slots": [{"name": "mirror",
    "marker": "aruco_4x4_50:1", "size_mm": 40, "marker_from_part": {"rotation_wxyz": [1,0,0,0], "translation_m": [0,0,0]},
    "variants": [{"name": "a", "mesh": "a.obj", "units": "m"}]}]})");
  }
  void TearDown() override { unsetenv("LIMN_CAD"); }

  // limn-cad, which begins when the file "go" is there.
  void make_limn_cad_wait() {
    const auto program = scene::limn_cad_for("a.step");
    ASSERT_TRUE(program) << program.message();
    const fs::path waits =
        write("waits.sh", "#!/bin/sh\nwhile [ ! -e '" + (folder / "go").string() +
                              "' ]; do sleep 0.05; done\nexec '" + program->string() + "' \"$@\"\n");
    fs::permissions(waits, fs::perms::owner_all);
    setenv("LIMN_CAD", waits.c_str(), 1);
  }

  static LoadedScene next_scene(SceneWatch* watch) {
    for (int i = 0; i < 3000; ++i, std::this_thread::sleep_for(10ms))
      if (auto changed = watch->take_changed_scene()) {
        EXPECT_TRUE(*changed) << changed->message();
        return *changed ? std::move(**changed) : LoadedScene();
      }
    ADD_FAILURE() << "the scene was not loaded again within 30 s";
    return {};
  }
  static std::string variants(const LoadedScene& loaded) {
    std::string names;
    for (const scene::Slot& slot : loaded.scene.slots)
      for (const scene::Variant& variant : slot.variants) names += variant.name + " ";
    return names;
  }
};

TEST_F(AWatchedScene, LoadsOtherFilesWhileACadFileIsRead) {
  make_limn_cad_wait();
  SceneWatch watch(folder);
  write("slots/mirror/b.step", test::box_file("mm", "AUTOMOTIVE_DESIGN"));
  const LoadedScene first = next_scene(&watch);
  EXPECT_EQ(variants(first), "a ");
  ASSERT_EQ(first.skipped_variants.size(), 1u);
  EXPECT_EQ(first.skipped_variants[0].variant, "b");
  EXPECT_NE(first.skipped_variants[0].why.find("limn-cad is still reading it"), std::string::npos)
      << first.skipped_variants[0].why;
  fs::copy_file(folder / "a.obj", folder / "slots/mirror/c.obj");
  EXPECT_EQ(variants(next_scene(&watch)), "a c ");
  write("go", "");
  std::string last;
  for (int i = 0; i < 3 && last != "a b c "; ++i) last = variants(next_scene(&watch));
  EXPECT_EQ(last, "a b c ");
}

TEST_F(AWatchedScene, SaysWhyACadFileCannotBeRead) {
  SceneWatch watch(folder);
  write("slots/mirror/b.step", "ISO-10303-21;\nHEADER;\n");
  std::string why;
  for (int i = 0; i < 3 && (i == 0 || why.find("still reading") != std::string::npos); ++i) {
    const LoadedScene loaded = next_scene(&watch);
    ASSERT_EQ(loaded.skipped_variants.size(), 1u);
    why = loaded.skipped_variants[0].why;
  }
  EXPECT_EQ(why.find("still reading"), std::string::npos) << why;
  EXPECT_NE(why.find("b.step"), std::string::npos) << why;
  std::this_thread::sleep_for(500ms);
  EXPECT_FALSE(watch.take_changed_scene()) << "it is tried again and again";
}

TEST_F(AWatchedScene, TriesAFileOnceMoreWhenTheProgramIsAtFault) {
  setenv("LIMN_CAD", "/bin/false", 1);
  SceneWatch watch(folder);
  write("slots/mirror/b.step", test::box_file("mm", "AUTOMOTIVE_DESIGN"));
  std::string why;
  for (int i = 0; i < 4 && (i == 0 || why.find("still reading") != std::string::npos); ++i) {
    const LoadedScene loaded = next_scene(&watch);
    ASSERT_EQ(loaded.skipped_variants.size(), 1u);
    why = loaded.skipped_variants[0].why;
  }
  EXPECT_EQ(why.find("still reading"), std::string::npos) << why;
  std::this_thread::sleep_for(500ms);
  EXPECT_FALSE(watch.take_changed_scene()) << "it is tried again and again";
}

}  // namespace
}  // namespace limn::session
