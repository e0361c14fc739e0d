#include "apps/simulate.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/image_io.h"
#include "core/rig.h"
#include "sim/world.h"
#include "tests/support/json.h"
#include "tests/support/matchers.h"
#include "tracker/marker_image.h"

namespace limn {
namespace {

using namespace test;
namespace fs = std::filesystem;

const fs::path k_bench = fs::path(LIMN_SOURCE_DIR) / "config" / "worlds" / "bench.json";

double mean(const fs::path& path) { return cv::mean(read_image(path).value())[0]; }

TEST(Simulate, WritesImagesTheTruthAndTheRig) {
  const fs::path out = test_folder() / "out";
  const fs::path shown = test_folder() / "half.png";
  cv::Mat half = cv::Mat::zeros(800, 1280, CV_8U);
  half.colRange(0, 640) = 255;
  ASSERT_TRUE(write_png(shown, half));
  const auto done = apps::run_simulate(
      {.world = k_bench, .out = out, .show = {"projector0=" + shown.string()}, .variants = "mirror=sport"});
  ASSERT_TRUE(done) << done.message();
  const double ambient = mean(out / "camera0-ambient.png"), half_lit = mean(out / "camera0-shown.png");
  const double white = mean(out / "camera0-white.png");
  EXPECT_LT(ambient + 5, half_lit);
  EXPECT_LT(half_lit + 5, white);
  EXPECT_GT(cv::norm(read_image(out / "camera0-still-life.png").value(),
                     read_image(out / "camera0-white.png").value(), cv::NORM_INF),
            50);

  const auto json = test::read_json(out / "truth.json");
  EXPECT_EQ(json["slots"]["mirror"]["variant"], "sport");
  const sim::World world = sim::load_world(k_bench, tracker::marker_image).value();
  const Rig rig = load_rig(out / "rig").value();
  ASSERT_EQ(json["markers"].size(), 10U);
  const auto& marker = json["markers"][0];
  const Pose pose = *sim::world_from_marker(world, MarkerName::parse(marker["name"]).value());
  const auto px = *rig.cameras[0].project(pose * Eigen::Vector3d(-0.02, -0.02, 0));  // top-left corner
  const auto& corner = marker["cameras"]["camera0"]["corners_px"][0];
  EXPECT_TRUE(near(Eigen::Vector2d(corner[0], corner[1]), px, 1e-6));
  EXPECT_TRUE(marker["cameras"]["camera0"]["visible"]);
}

TEST(Simulate, BadOptionsSayWhatWasExpected) {
  const fs::path out = test_folder();
  const auto unknown =
      apps::run_simulate({.world = k_bench, .out = out, .show = {"projector9=x.png"}, .variants = ""});
  ASSERT_FALSE(unknown);
  EXPECT_TRUE(unknown.error().wrong_usage);
  EXPECT_NE(unknown.message().find("projector9"), std::string::npos);
  const auto variant =
      apps::run_simulate({.world = k_bench, .out = out, .show = {}, .variants = "mirror=golden"});
  ASSERT_FALSE(variant);
  EXPECT_TRUE(variant.error().wrong_usage);
  const fs::path small = out / "small.png";
  ASSERT_TRUE(write_png(small, cv::Mat::zeros(10, 20, CV_8U)));
  const auto size = apps::run_simulate(
      {.world = k_bench, .out = out, .show = {"projector0=" + small.string()}, .variants = ""});
  ASSERT_FALSE(size);
  EXPECT_NE(size.message().find("1280x800"), std::string::npos) << size.message();
  const auto absent =
      apps::run_simulate({.world = out / "absent.json", .out = out, .show = {}, .variants = ""});
  ASSERT_FALSE(absent);
  EXPECT_NE(absent.message().find("absent.json"), std::string::npos);
}

}  // namespace
}  // namespace limn
