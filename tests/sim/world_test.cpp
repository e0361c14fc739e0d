#include "sim/world.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test;
namespace fs = std::filesystem;

const fs::path k_worlds = fs::path(LIMN_SOURCE_DIR) / "config" / "worlds";

// A substitute for the tracker's families: black with a white middle.
Result<MarkerDrawing> plain_marker(const MarkerName&) {
  cv::Mat image = cv::Mat::zeros(6, 6, CV_8U);
  image(cv::Rect(2, 2, 2, 2)) = 255;
  return MarkerDrawing{image};
}

Result<sim::World> loaded(std::string text) {
  const fs::path path = test_folder() / "world.json";
  if (const auto written = write_file(path, text); !written) return written.error();
  return sim::load_world(path, plain_marker);
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  LIMN_CHECK(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

const std::string k_small = R"({
  "schema": "limn.world/1",
  "cameras": [{"name": "camera0", "size": [320, 240], "lens": {"model": "LENSMODEL_PINHOLE", "values": [400, 400, 160, 120]},
               "eye_m": [0, 0, 0], "target_m": [0, 1, 0], "exposure": 0.5, "psf_px": 0.7}],
  "projectors": [{"name": "projector0", "size": [200, 150], "lens": {"model": "LENSMODEL_PINHOLE", "values": [200, 200, 100, 75]},
                  "eye_m": [0.3, 0, 0], "target_m": [0, 1, 0], "illuminance_at_1m": 2}],
  "room": {"ambient": 0.1},
  "objects": [{"name": "box", "box_m": [0.1, 0.2, 0.3], "albedo": [0.1, 0.2, 0.3],
               "world_from_object": {"rotation_wxyz": [1, 0, 0, 0], "translation_m": [0, 1, 0]}}]
})";

TEST(World, ExampleWorldsLoad) {
  for (const auto& [name, cameras, projectors] :
       {std::tuple{"bench.json", 1U, 1U}, {"studio.json", 1U, 2U}}) {
    const auto world = sim::load_world(k_worlds / name, plain_marker);
    ASSERT_TRUE(world) << world.message();
    EXPECT_EQ(world->rig.cameras.size(), cameras);
    EXPECT_EQ(world->rig.projectors.size(), projectors);
    EXPECT_EQ(world->markers.size(), 10U);
    EXPECT_NE(world->find("prototype"), nullptr);
    EXPECT_NE(world->find("table"), nullptr);
    const scene::PosedScene parts = sim::true_poses(*world);
    EXPECT_EQ(parts.parts.size(), 2U);
  }
}

TEST(World, ValuesArriveWhereTheyBelong) {
  const auto world = loaded(k_small);
  ASSERT_TRUE(world) << world.message();
  EXPECT_EQ(world->camera_effects[0].exposure, 0.5);
  EXPECT_EQ(world->camera_effects[0].psf_px, 0.7);
  EXPECT_EQ(world->projector_effects[0].illuminance_at_1m, 2);
  EXPECT_TRUE(near(*world->rig.cameras[0].project({0, 1, 0}), Eigen::Vector2d(160, 120), 1e-9));
  EXPECT_TRUE(near(world->find("box")->albedo, Eigen::Vector3d(0.3, 0.2, 0.1), 1e-12));  // BGR
  EXPECT_EQ(world->find("box")->mesh->triangles.size(), 12U);
}

TEST(World, ShakeAndFlickerArriveAndAreOffByDefault) {
  const auto still = loaded(k_small);
  ASSERT_TRUE(still) << still.message();
  EXPECT_EQ(still->camera_effects[0].shake_px, 0);
  EXPECT_EQ(still->camera_effects[0].flicker, 0);
  const auto shaken = loaded(replaced(k_small, "0.7}", R"(0.7, "shake_px": 0.2, "flicker": 0.015})"));
  ASSERT_TRUE(shaken) << shaken.message();
  EXPECT_EQ(shaken->camera_effects[0].shake_px, 0.2);
  EXPECT_EQ(shaken->camera_effects[0].flicker, 0.015);
}

TEST(World, ColoursArriveAsBlueGreenRed) {
  std::string text = k_small;
  text.replace(text.find(R"("exposure")"), 0,
               R"("colour": true, "sensitivity": [[1, 0.2, 0], [0, 1, 0.1], [0, 0, 1]], )");
  text.replace(text.find(R"("illuminance_at_1m")"), 0, R"("channel_gamma": [1.1, 1, 0.9], "s_curve": 0.3, )");
  const auto world = loaded(text);
  ASSERT_TRUE(world) << world.message();
  EXPECT_EQ(world->camera_effects[0].sensitivity(2, 1), 0.2);  // red sees green
  EXPECT_EQ(world->camera_effects[0].sensitivity(1, 0), 0.1);  // green sees blue
  EXPECT_EQ(world->projector_effects[0].channel_gamma, Eigen::Vector3d(0.9, 1, 1.1));
  EXPECT_EQ(world->projector_effects[0].s_curve, 0.3);
}

TEST(World, EffectsSwitchOffTogetherButExposureStays) {
  const sim::World world =
      sim::without_effects(sim::load_world(k_worlds / "studio.json", plain_marker).value());
  EXPECT_EQ(world.camera_effects[0].psf_px, 0);
  EXPECT_EQ(world.camera_effects[0].full_well_e, 0);
  EXPECT_EQ(world.camera_effects[0].exposure, 0.57);
  EXPECT_EQ(world.projector_effects[1].gamma, 1);
  EXPECT_EQ(world.projector_effects[1].aperture_m, 0);
  EXPECT_EQ(world.projector_effects[1].illuminance_at_1m, 2);
}

TEST(World, MarkersMoveWithThePrototype) {
  sim::World world = sim::load_world(k_worlds / "bench.json", plain_marker).value();
  const MarkerName tag{"apriltag_36h11", "3"}, mirror{"aruco_4x4_50", "0"};
  const Pose before = world.world_from_prototype, tag_before = *sim::world_from_marker(world, tag);
  const Pose mirror_before = *sim::world_from_marker(world, mirror);
  const Pose motion(exp_rotation({0.1, 0.2, -0.3}), {0.15, 0, 0.02});
  sim::move_prototype(world, motion * before);
  EXPECT_TRUE(pose_near(*sim::world_from_marker(world, tag), motion * tag_before, 1e-9, 1e-9));
  EXPECT_TRUE(pose_near(*sim::world_from_marker(world, mirror), motion * mirror_before, 1e-9, 1e-9));
  EXPECT_TRUE(pose_near(world.find("prototype")->world_from_object, motion * before, 1e-9, 1e-9));
}

TEST(World, AMarkersSquareHasItsTrueSizeWithinThePlate) {
  const sim::World world = sim::load_world(k_worlds / "bench.json", plain_marker).value();
  const sim::Object* plate = world.find("marker-apriltag_36h11:0");
  ASSERT_NE(plate, nullptr);
  const double side = 2.0 * plate->mesh->positions[2].x();
  int first = 0;  // columns of white margin
  while (plate->texture.at<std::uint8_t>(plate->texture.rows / 2, first) == 255) ++first;
  EXPECT_NEAR(side * (plate->texture.cols - 2 * first) / plate->texture.cols, 0.040, 1e-7);
}

TEST(World, BadFilesAreErrorsThatNameThePlace) {
  const std::pair<std::string, std::string> cases[] = {
      {replaced(k_small, "\"psf_px\"", "\"psf\""), "cameras[0]"},
      {replaced(k_small, "0.7}", "-0.7}"), "cameras[0].psf_px"},
      {replaced(k_small, "0.7}", "0.7, \"shake_px\": -0.2}"), "cameras[0].shake_px"},
      {replaced(k_small, "0.7}", "0.7, \"flicker\": 1.5}"), "cameras[0].flicker"},
      {replaced(k_small, "[320, 240]", "[320.5, 240]"), "cameras[0].size"},
      {replaced(k_small, "\"exposure\": 0.5", "\"exposure\": \"much\""), "cameras[0].exposure"},
      {replaced(k_small, "LENSMODEL_PINHOLE", "FISHEYE"), "cameras[0].lens"},
      {replaced(k_small, "\"room\": {\"ambient\": 0.1},", ""), "room"},
      {replaced(k_small, "[0.1, 0.2, 0.3]", "[0.1, 0, 0.3]"), "objects[0]"},
      {replaced(k_small, "\"target_m\": [0, 1, 0], \"exp", "\"target_m\": [0, 0, 9], \"exp"),
       "cameras[0].target_m"},
      {replaced(k_small, "limn.world/1", "limn.world/9"), "schema"},
      {replaced(k_small, "\"cameras\"",
                "\"scene\": \"nowhere\", \"world_from_prototype\": {\"rotation_wxyz\": [1, 0, 0, 0], "
                "\"translation_m\": [0, 0, 0]}, \"cameras\""),
       "nowhere"}};
  for (const auto& [text, where] : cases) {
    const auto world = loaded(text);
    ASSERT_FALSE(world) << where;
    EXPECT_NE(world.message().find(where), std::string::npos) << world.message();
  }
  EXPECT_FALSE(sim::load_world(k_worlds / "absent.json", plain_marker));
}

}  // namespace
}  // namespace limn
