// Compares what `limn plan` predicts for a described rig with the result on the virtual rig.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/calibrate.h"
#include "calib/solve.h"
#include "core/file.h"
#include "sim/world.h"
#include "tests/calib/true_rig.h"
#include "tests/support/matchers.h"
#include "tests/wizard/small_plan.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/design/rig_design.h"

namespace limn::design {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const fs::path k_config = fs::path(LIMN_SOURCE_DIR) / "config";

// Camera 0 and one projector, in the camera's world.
test::TrueRig true_pair(const sim::World& world, std::size_t projector) {
  const Pose world_from_camera = world.rig.cameras[0].imager_from_world.inverse();
  test::TrueRig pair;
  for (const Imager* imager : {&world.rig.cameras[0], &world.rig.projectors[projector]}) {
    auto& list = imager == &world.rig.cameras[0] ? pair.rig.cameras : pair.rig.projectors;
    list.push_back(*imager);
    list.back().imager_from_world = imager->imager_from_world * world_from_camera;
  }
  // The panel faces -z of its frame, the door +z.
  pair.world_from_prototype = world_from_camera.inverse() * world.world_from_prototype *
                              Pose(exp_rotation({M_PI, 0, 0}), Eigen::Vector3d::Zero());
  return pair;
}

void expect_within_two(double found, double expected, const std::string& what) {
  EXPECT_LT(found, 2 * expected) << what;
  EXPECT_GT(found, expected / 2) << what;
}

// Calibrates on the plan's virtual rig and compares. Without `own_noise`, the noise of `described` is
// replaced by the noise that the report found.
void check_rig(DescribedRig described,
               const fs::path& plan,
               const fs::path& world_file,
               bool own_noise,
               const fs::path& out) {
  testing::internal::CaptureStdout();
  const Status calibrated = apps::run_calibrate({.plan = plan, .out = out, .all = true});
  testing::internal::GetCapturedStdout();
  ASSERT_TRUE(calibrated.ok()) << calibrated.message();
  const json report = test::read_json(out / "report.json");
  const auto rig = load_rig(out);
  ASSERT_TRUE(rig) << rig.message();
  const auto world = sim::load_world(world_file, tracker::marker_image);
  ASSERT_TRUE(world) << world.message();
  if (!own_noise) {
    described.corner_px = report["devices"][0]["rms_px"].get<double>() / std::sqrt(2.0);
    described.match_px = report["devices"][1]["rms_px"].get<double>() / std::sqrt(2.0);
  }
  const auto predicted_accuracy = predict_accuracy(described);
  ASSERT_TRUE(predicted_accuracy) << predicted_accuracy.message();

  ASSERT_EQ(predicted_accuracy->error_mm.size(), rig->projectors.size());
  for (std::size_t i = 0; i < rig->projectors.size(); ++i) {
    const test::TrueRig truth = true_pair(*world, i);
    Rig pair;
    pair.cameras = {rig->cameras[0]};
    pair.projectors = {rig->projectors[i]};
    auto rng = test::test_rng();
    // The prototype is measured as well as markers are: 0.03 px.
    const double true_mm =
        test::p95(test::landed(truth, pair, test::prototype_mesh(test::Prototype::panel), 0.03, 1000, &rng)
                      .pooled_mm());
    const double reported_mm = report["predicted_error_mm"]["per_projector"][rig->projectors[i].name];
    std::printf("%s, %s: predicted %.3f mm (calibration %.3f, measuring %.3f), reported %.3f, true %.3f\n",
                plan.stem().c_str(), rig->projectors[i].name.c_str(), predicted_accuracy->error_mm[i],
                predicted_accuracy->calibration_mm[i], predicted_accuracy->measuring_mm[i], reported_mm,
                true_mm);
    expect_within_two(predicted_accuracy->error_mm[i], reported_mm,
                      rig->projectors[i].name + " as the report states it");
    expect_within_two(predicted_accuracy->error_mm[i], true_mm, rig->projectors[i].name + " as it truly is");
    // The pixel sizes are compared with the true rig's.
    const Imager& projector = world->rig.projectors[i];
    const Eigen::Vector3d p = projector.imager_from_world * described.p_centre;
    EXPECT_NEAR(predicted_accuracy->projectors[i].pixel_mm, 1000 * p.z() / projector.lens.fx(),
                0.02 * predicted_accuracy->projectors[i].pixel_mm);
  }
}

// The bench with fewer pixels, to save time. The noise is that of the report, the rest is as described.
TEST(ForeseeTruth, ACoarseBenchComesOutAsForeseen) {
  const fs::path folder = test::test_folder();
  const fs::path plan = test::small_plan(folder);
  const json world = test::read_json(folder / "world.json");
  json described = test::read_json(k_config / "described/bench.json");
  described["cameras"][0]["size"] = world["cameras"][0]["size"];
  described["projectors"][0]["size"] = world["projectors"][0]["size"];
  described["board"] = test::read_json(plan)["board"];
  const auto loaded = load_described(test::write_json(folder / "described.json", described));
  ASSERT_TRUE(loaded) << loaded.message();
  check_rig(*loaded, plan, folder / "world.json", false, folder / "rig");
}

// Takes minutes at full size: LIMN_RIGS=bench or studio selects the rig.
TEST(ForeseeTruth, ARigOfTheExamplesComesOutAsForeseen) {
  const char* name = std::getenv("LIMN_RIGS");
  if (!name) GTEST_SKIP() << "takes minutes for each rig: LIMN_RIGS is not set";
  const std::string file = std::string(name) + ".json";
  const auto described = load_described(k_config / "described" / file);
  ASSERT_TRUE(described) << described.message();
  check_rig(*described, k_config / "plans" / file, k_config / "worlds" / file, true,
            test::test_folder() / "rig");
}

}  // namespace
}  // namespace limn::design
