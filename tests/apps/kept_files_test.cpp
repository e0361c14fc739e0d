// Files that earlier versions wrote must still be read. A folder of kept/ is never changed: a version that
// writes another schema adds a folder of its own.
#include <gtest/gtest.h>

#include <filesystem>

#include "calib/capture_set.h"
#include "core/file.h"
#include "core/rig.h"
#include "device/devices_file.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "tests/support/matchers.h"
#include "wizard/capture/capture_plan.h"

namespace limn {
namespace {

namespace fs = std::filesystem;

const fs::path k_kept = LIMN_SOURCE_DIR "/tests/apps/kept";

TEST(KeptFiles, OfVersion01AreRead) {
  const fs::path folder = k_kept / "0.1";
  const auto rig = load_rig(folder / "rig");
  ASSERT_TRUE(rig) << rig.message();
  EXPECT_EQ(rig->cameras.at(0).name, "camera0");
  EXPECT_EQ(rig->cameras.at(0).width, 576);

  const auto devices = device::load_devices(folder / "devices.json");
  ASSERT_TRUE(devices) << devices.message();
  EXPECT_FALSE(devices->cameras.empty());
  EXPECT_FALSE(devices->displays.empty());

  const auto plan = wizard::load_plan(folder / "plan.json");
  ASSERT_TRUE(plan) << plan.message();
  EXPECT_EQ(plan->world_from_board.size(), 9u);

  const auto scene = scene::load_scene(LIMN_SOURCE_DIR "/config/scenes/door");
  ASSERT_TRUE(scene) << scene.message();
  const auto look = scene::load_look(folder / "look.json", *scene);
  ASSERT_TRUE(look) << look.message();
  EXPECT_EQ(look->parts.at(0).variant, "sport");

  // The images are not kept: loading only looks for their files.
  const fs::path filled = test::test_folder() / "captures";
  fs::copy(folder / "captures", filled, fs::copy_options::recursive);
  constexpr int k_gray_images = 44;  // what the code has for 1280x800
  fs::create_directories(filled / "pose00" / "camera0");
  for (int i = 0; i < k_gray_images; ++i)
    ASSERT_TRUE(write_file(filled / "pose00" / "camera0" / fmt::format("{:03}.png", i), "an image"));
  const auto captures = calib::load_captures(filled);
  ASSERT_TRUE(captures) << captures.message();
  EXPECT_EQ(captures->projectors.at(0).width, 1280);
  EXPECT_EQ(captures->board.columns, 11);
}

}  // namespace
}  // namespace limn
