// Files that earlier versions wrote must still be read. A folder of kept/ is never changed: a version that
// writes another schema adds a folder of its own.
#include <gtest/gtest.h>

#include <ctime>
#include <filesystem>

#include "apps/replay.h"
#include "calib/capture_set.h"
#include "core/file.h"
#include "core/rig.h"
#include "device/devices_file.h"
#include "nodes/room_keys.h"
#include "remote/http/certificate.h"
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

// A scene whose badge another marker carries since somebody paired it, with a saved look, as `limn live`
// records it.
TEST(KeptFiles, ARecordingWithItsSceneLookAndPairingIsRead) {
  const fs::path folder = test::test_folder() / "recording";
  fs::copy(k_kept / "0.1/recording", folder, fs::copy_options::recursive);
  const auto scene = scene::load_scene(folder / "scene");
  ASSERT_TRUE(scene) << scene.message();
  EXPECT_EQ(scene->slots.at(0).name, "badge");
  const auto look = scene::load_look(folder / "scene/looks/evening.json", *scene);
  ASSERT_TRUE(look) << look.message();
  const auto paired =
      scene::with_pairings(folder / "scene/pairings.json", *scene, scene::initial_show_state(*scene));
  ASSERT_TRUE(paired) << paired.message();
  EXPECT_EQ(scene::slot_marker(*scene, *paired, 0).text(), "aruco_4x4_50:9");

  // A version that finds markers better has other poses; it has still read and replayed all.
  apps::ReplayOptions replay;
  replay.session = folder;
  const Status replayed = apps::run_replay(replay);
  const bool is_read =
      replayed.ok() || replayed.message().starts_with(folder.string() + ": expected the recorded ");
  EXPECT_TRUE(is_read) << replayed.message();
}

// As `limn solve` writes it from response captures; the maps of the colour mixing are not kept.
TEST(KeptFiles, ARigWithAMeasuredResponseIsRead) {
  const auto rig = load_rig(k_kept / "0.1/solved");
  ASSERT_TRUE(rig) << rig.message();
  ASSERT_EQ(rig->responses.size(), 1u);
  EXPECT_EQ(rig->camera_responses.size(), 1u);
  EXPECT_TRUE(rig->responses[0].vignetting.has_value());
}

// Keys that nobody uses, of a remote and of a room. They end in November 2036; a remote's authority that ends
// within the life of a certificate is made anew.
TEST(KeptFiles, CertificatesStayWhatDevicesTrust) {
  constexpr std::time_t k_2034 = 2019686400;
  if (std::time(nullptr) > k_2034) GTEST_SKIP() << "the kept certificates have ended: keep newer ones";
  const fs::path folder = test::test_folder() / "own";
  fs::copy(k_kept / "0.1/own", folder, fs::copy_options::recursive);
  for (const auto& entry : fs::recursive_directory_iterator(folder))  // git does not keep who may read them
    fs::permissions(entry, entry.is_directory() ? fs::perms(0700) : fs::perms(0600));
  const auto certificate = remote::load_or_create_certificate(folder, {"192.168.7.2"});
  ASSERT_TRUE(certificate) << certificate.message();
  EXPECT_TRUE(certificate->authority_fingerprint.starts_with("A8:70:F1:8B:78:37:72:AA"))
      << certificate->authority_fingerprint;
  for (const nodes::RoomRole role : {nodes::RoomRole::host, nodes::RoomRole::node}) {
    const auto keys = nodes::load_room(folder / "rooms/studio", role);
    EXPECT_TRUE(keys) << keys.message();
  }
}

}  // namespace
}  // namespace limn
