// A session whose bodies carry balls, seen by a camera for visible and one for infrared light.

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "apps/live.h"
#include "apps/replay.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/session/studio.h"
#include "tests/support/matchers.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* k_wand = "constellation:wand.json";

json world_json() {
  json world = read_json(test::config_folder() / "worlds/balls.json");
  world["scene"] = (test::config_folder() / "scenes/balls").string();
  return world;
}

apps::LiveOptions options_for(const fs::path& folder, const json& world, double seconds) {
  apps::LiveOptions options;
  options.world = write_json(folder / "world.json", world);
  options.out = folder / "out";
  options.script = write_json(
      folder / "script.json",
      script_of(seconds, {{{"at_s", 0.5},
                           {"move", k_wand},
                           {"home_from_marker",
                            {{"rotation_wxyz", {1, 0, 0, 0}}, {"translation_m", {-0.03, 0.01, 0}}}}}}));
  return options;
}

TEST(BallSession, PartsOnBallsAreInPlaceAndTheReplayIsExact) {
  const fs::path folder = test::test_folder();
  apps::LiveOptions options = options_for(folder, world_json(), 1.2);
  options.record = folder / "recording";
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();
  const json summary = read_json(folder / "out/session.json");
  EXPECT_LT(summary.at("placement_mm").at("median").get<double>(), 0.1);
  EXPECT_EQ(summary.at("pictures_with_lost_bodies"), 0);
  const auto poses = lines_of(folder / "out/poses.csv");
  EXPECT_NE(poses.back().find(",badge,"), std::string::npos);
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  replay.out = folder / "replayed";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
  EXPECT_EQ(poses, lines_of(folder / "replayed/poses.csv"));
}

// The wand hangs in front of the block, where the badge is painted, in the light of the projector. `sees`:
// what both cameras see. Returns how many pixels of the projector's image are dark on the badge.
int dark_on_badge(const fs::path& folder, const char* sees) {
  json world = world_json();
  world["slot_markers"]["badge"]["prototype_from_marker"]["translation_m"] = {-0.06, 0.05, 0.14};
  world["room"]["ambient"] = 0.6;
  if (std::string(sees) == "infrared")
    for (json& camera : world["cameras"])
      camera["sees"] = sees, camera["colour"] = false, camera["exposure"] = 0.08;
  // The badge lies behind the wand instead of beside it.
  fs::copy(test::config_folder() / "scenes/balls", folder / "scene");
  std::string scene = read_file(folder / "scene/scene.json").value();
  const auto at = scene.find("[-0.26, 0.01, -0.06]");
  scene.replace(at, 20, "[0, 0, -0.10]");
  EXPECT_TRUE(write_file(folder / "scene/scene.json", scene));
  world["scene"] = "scene";
  apps::LiveOptions options = options_for(folder, world, 0.6);
  options.script.clear();
  options.seconds = 0.6;
  const Status lived = apps::run_live(options);
  EXPECT_TRUE(lived.ok()) << lived.message();
  const cv::Mat image = read_image(folder / "out/projector-projector0.png").value();
  cv::Rect badge;
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      if (image.at<cv::Vec3b>(y, x)[1] > 60)
        badge = badge.empty() ? cv::Rect(x, y, 1, 1) : badge | cv::Rect(x, y, 1, 1);
  EXPECT_GT(badge.area(), 5000);
  int dark = 0;
  for (int y = badge.y; y < badge.br().y; ++y)
    for (int x = badge.x; x < badge.br().x; ++x) dark += image.at<cv::Vec3b>(y, x)[1] == 0;
  return dark;
}

TEST(BallSession, NoLightFallsOnBallsThatACameraForVisibleLightSees) {
  EXPECT_GT(dark_on_badge(test::test_folder(), "visible"), 3000);  // a ball's disc has 3400 pixels
}

TEST(BallSession, OnlyCamerasForInfraredLightLeaveTheLightAsItIs) {
  EXPECT_LT(dark_on_badge(test::test_folder(), "infrared"), 100);
}

TEST(BallSession, ThePapersTriangleCarriesATripleToo) {
  const fs::path folder = test::test_folder();
  json world = world_json();
  world["cameras"].erase(0);  // one camera sees the three balls
  apps::LiveOptions options = options_for(folder, world, 1.2);
  options.record = folder / "recording";
  options.triple_pose = tracker::TriplePose::triangle;
  const Status refused = apps::run_live(options);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.message().find("--triple-pose"), std::string::npos) << refused.message();
  options.prediction = tracker::Prediction::linear;
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();
  const double placement_mm = read_json(folder / "out/session.json").at("placement_mm").at("median");
  EXPECT_GT(placement_mm, 0);
  EXPECT_LT(placement_mm, 2);
  EXPECT_EQ(read_json(folder / "recording/session.json").at("triple_pose"), "triangle");
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  replay.out = folder / "replayed";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
  EXPECT_EQ(lines_of(folder / "out/poses.csv"), lines_of(folder / "replayed/poses.csv"));
}

}  // namespace
}  // namespace limn::session
