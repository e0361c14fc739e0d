#include "apps/recheck.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/file.h"
#include "core/rig.h"
#include "sim/world.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"
#include "tracker/marker_image.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using namespace test;
using calib::RigVerdict;
using Json = nlohmann::json;

// The bench without its prototype; its projector's target is raised by `up_m`.
fs::path bench_world(const fs::path& path, double up_m) {
  Json world = empty_bench();
  world["projectors"][0]["target_m"][2] = world["projectors"][0]["target_m"][2].get<double>() + up_m;
  return write_json(path, world);
}

// A plan with one pose, where the light reaches the board well.
fs::path plan_of(const fs::path& world) {
  Json plan = read_json(config_folder() / "plans/bench.json");
  plan["world"] = world.filename();
  plan["world_from_board"] = Json::array({plan["world_from_board"][3]});
  return write_json(world.parent_path() / ("plan-" + world.filename().string()), plan);
}

// RMS distance between the lights of two projectors for the same pixels, on the plane y = 0 around the
// working volume's middle.
double light_apart_mm(const Imager& a, const Imager& b) {
  double squares = 0;
  int count = 0;
  for (double x = -0.2; x <= 0.2; x += 0.1) {
    for (double z = 0.2; z <= 0.6; z += 0.1) {
      const Eigen::Vector3d p(x, 0, z);
      const auto ray = b.ray(*a.project(p));
      const Eigen::Vector3d landed = ray->p_origin - ray->p_origin.y() / ray->d.y() * ray->d;
      squares += (landed - p).squaredNorm();
      ++count;
    }
  }
  return 1e3 * std::sqrt(squares / count);
}

TEST(RecheckCommand, FindsAndRepairsANudgeOnTheVirtualRig) {
  const fs::path folder = test_folder();
  const fs::path sound_world = bench_world(folder / "sound.json", 0),
                 nudged_world = bench_world(folder / "nudged.json", 0.00444);
  const Rig rig = sim::load_world(sound_world, tracker::marker_image).value().rig;
  const Rig truth = sim::load_world(nudged_world, tracker::marker_image).value().rig;
  const double turned = angle_between(rig.projectors[0].imager_from_world.rotation,
                                      truth.projectors[0].imager_from_world.rotation);
  ASSERT_NEAR(turned * 180 / std::numbers::pi, 0.2, 0.001);
  ASSERT_TRUE(save_rig(rig, folder / "rig").ok());

  RecheckCommand sound{.rig = folder / "rig", .plan = plan_of(sound_world), .out = folder / "before"};
  const auto before = recheck(sound);
  ASSERT_TRUE(before) << before.message();
  EXPECT_EQ(before->result.verdict, RigVerdict::sound);
  // In 15 s there are 150 images at ten per second, enough for six projectors of this size.
  EXPECT_EQ(before->images, 11 + 10 + 2);
  EXPECT_EQ(load_rig(sound.out).value().projectors[0].imager_from_world.matrix(),
            load_rig(sound.rig).value().projectors[0].imager_from_world.matrix());

  RecheckCommand nudged{.rig = folder / "rig", .plan = plan_of(nudged_world), .out = folder / "after"};
  const auto undecided = recheck(nudged);
  ASSERT_TRUE(undecided) << undecided.message();
  EXPECT_EQ(undecided->result.verdict, RigVerdict::undecided);

  // The same captures; the board is where it was before.
  RecheckCommand again{
      .rig = folder / "rig", .captures = nudged.out / "captures", .out = folder / "repaired"};
  again.still = sound.out / "recheck.json";
  const auto after = recheck(again);
  ASSERT_TRUE(after) << after.message();
  ASSERT_EQ(after->result.verdict, RigVerdict::moved);
  EXPECT_EQ(after->result.candidates[0].device, "projector0");
  EXPECT_NEAR(after->result.candidates[0].degrees, 0.2, 0.02);
  const auto repaired = load_rig(again.out);
  ASSERT_TRUE(repaired) << repaired.message();
  EXPECT_GT(light_apart_mm(rig.projectors[0], truth.projectors[0]), 3);
  EXPECT_LT(light_apart_mm(repaired->projectors[0], truth.projectors[0]), 1);
  EXPECT_EQ(repaired->projectors[0].lens.values, rig.projectors[0].lens.values);
  EXPECT_TRUE(fs::exists(again.out / "projector0.cameramodel"));
  EXPECT_EQ(read_json(again.out / "rig.json")["provenance"]["re_solved"]["device"], "projector0");
  const Json report = read_json(again.out / "recheck.json");
  EXPECT_EQ(report["verdict"], "nudged");
  EXPECT_TRUE(report["boards"].contains("pose00"));

  // A reference without this pose, and a file that is no recheck.json.
  Json other = report;
  other["boards"] = {{"pose77", report["boards"]["pose00"]}};
  ASSERT_TRUE(write_file(folder / "other.json", other.dump()).ok());
  again.still = folder / "other.json";
  EXPECT_NE(recheck(again).message().find("other.json: boards: expected"), std::string::npos);
  again.still = again.out / "rig.json";
  EXPECT_NE(recheck(again).message().find("limn.recheck/1"), std::string::npos);
}

// The studio with its prototype; projector1's target is raised by `up_m`.
fs::path studio_plan(const fs::path& folder, double up_m) {
  const fs::path config = config_folder();
  Json world = read_json(config / "worlds/studio.json");
  world["scene"] = (config / "scenes/door").string();
  world["projectors"][1]["target_m"][2] = world["projectors"][1]["target_m"][2].get<double>() + up_m;
  Json plan = read_json(config / "plans/studio.json");
  plan["world"] = "world.json";
  fs::create_directories(folder);
  write_json(folder / "world.json", world);
  return write_json(folder / "plan.json", plan);
}

TEST(RecheckCommand, ThePrototypeAloneTellsWhatMoved) {
  const fs::path folder = test_folder();
  studio_plan(folder / "sound", 0);
  const fs::path nudged_plan = studio_plan(folder / "nudged", 0.006);
  const Rig rig = sim::load_world(folder / "sound/world.json", tracker::marker_image).value().rig;
  const Rig truth = sim::load_world(folder / "nudged/world.json", tracker::marker_image).value().rig;
  ASSERT_TRUE(save_rig(rig, folder / "rig").ok());
  const auto after =
      recheck({.rig = folder / "rig", .plan = nudged_plan, .prototype = true, .out = folder / "nudged/out"});
  ASSERT_TRUE(after) << after.message();
  ASSERT_EQ(after->result.verdict, RigVerdict::moved);
  EXPECT_EQ(after->result.candidates[0].device, "projector1");
  EXPECT_EQ(after->images, 2 * (11 + 10 + 2));
  const auto repaired = load_rig(folder / "nudged/out");
  ASSERT_TRUE(repaired) << repaired.message();
  const double apart_before_mm = light_apart_mm(rig.projectors[1], truth.projectors[1]),
               apart_mm = light_apart_mm(repaired->projectors[1], truth.projectors[1]);
  std::printf("light off by %.2f mm, after the repair by %.3f mm\n", apart_before_mm, apart_mm);
  EXPECT_GT(apart_before_mm, 3);
  EXPECT_LT(apart_mm, 0.3);
}

TEST(RecheckCommand, WantsCapturesOrAPlan) {
  const fs::path folder = test_folder();
  const Rig rig = sim::load_world(bench_world(folder / "world.json", 0), tracker::marker_image).value().rig;
  ASSERT_TRUE(save_rig(rig, folder / "rig").ok());
  const auto neither = recheck({.rig = folder / "rig", .out = folder / "out"});
  ASSERT_FALSE(neither);
  EXPECT_TRUE(neither.error().wrong_usage);
  const auto no_plan =
      recheck({.rig = folder / "rig", .captures = folder / "none", .prototype = true, .out = folder / "out"});
  EXPECT_TRUE(!no_plan && no_plan.error().wrong_usage);
  const auto devices =
      recheck({.rig = folder / "rig", .devices = folder / "devices.json", .out = folder / "out"});
  EXPECT_NE(devices.message().find("devices.json"), std::string::npos);
  const auto missing = recheck({.rig = folder / "rig", .captures = folder / "none", .out = folder / "out"});
  EXPECT_NE(missing.message().find("capture.json"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "out")) << "nothing is written when nothing was measured";
}

}  // namespace
}  // namespace limn::apps
