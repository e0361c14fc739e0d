// A camera for infrared light is calibrated with the others, by the board alone.

#include "apps/calibrate.h"
#include "core/rig.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"

namespace limn::wizard {
namespace {

namespace fs = std::filesystem;
using namespace test::literals;
using nlohmann::json;

// The plan of the bench, nearer together, for the world with balls, but without its scene.
fs::path plan_with(const fs::path& folder, bool is_first_infrared) {
  json world = test::read_json(test::config_folder() / "worlds/balls.json");
  for (const char* key : {"scene", "slot_markers"}) world.erase(key);
  for (json& object : world["objects"]) object.erase("moves_with_prototype");
  world["cameras"][1]["exposure"] = 2;  // the board is no mirror
  if (is_first_infrared) std::swap(world["cameras"][0], world["cameras"][1]);
  json plan = test::read_json(test::config_folder() / "plans/bench.json");
  plan["world"] = "world.json";
  plan["board"] = "charuco:11x8:30mm";
  for (json& pose : plan["world_from_board"]) {
    json& p = pose["translation_m"];
    p = {0.55 * (p[0].get<double>() + 0.165) - 0.13, 0.6 * p[1].get<double>() - 0.05,
         0.6 * (p[2].get<double>() - 0.42) + 0.51};
  }
  test::write_json(folder / "world.json", world);
  return test::write_json(folder / "plan.json", plan);
}

TEST(InfraredCalibration, TheBoardAlonePlacesTheCamera) {
  const fs::path folder = test::test_folder();
  const fs::path plan = plan_with(folder, false);
  const Status done =
      apps::run_calibrate({.plan = plan, .out = folder / "rig", .all = true, .terminal = true});
  ASSERT_TRUE(done.ok()) << done.message();
  const Rig rig = load_rig(folder / "rig").value();
  const Rig truth = sim::load_world(folder / "world.json", tracker::marker_image).value().rig;
  EXPECT_EQ(rig.cameras[0].sees, Spectrum::visible);
  EXPECT_EQ(rig.cameras[1].sees, Spectrum::infrared);
  const auto between = [](const Rig& of) {
    return of.cameras[1].imager_from_world * of.cameras[0].imager_from_world.inverse();
  };
  EXPECT_LT(angle_between(between(rig).rotation, between(truth).rotation), 0.05_deg);
  EXPECT_LT((between(rig).translation - between(truth).translation).norm(), 1_mm);
}

TEST(InfraredCalibration, AFirstCameraForInfraredLightIsRefusedByName) {
  const fs::path folder = test::test_folder();
  const Status refused =
      apps::run_calibrate({.plan = plan_with(folder, true), .out = folder / "rig", .terminal = true});
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.message().find("camera1: expected a first camera that sees visible light"),
            std::string::npos)
      << refused.message();
  EXPECT_FALSE(fs::exists(folder / "rig/rig.json"));
}

}  // namespace
}  // namespace limn::wizard
