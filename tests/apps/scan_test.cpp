#include "apps/scan.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/capture.h"
#include "apps/plan.h"
#include "apps/world_markers.h"
#include "core/file.h"
#include "core/rig.h"
#include "scene/nearest.h"
#include "scene/ply.h"
#include "sim/truth.h"
#include "sim/world.h"
#include "tests/support/matchers.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

const fs::path k_plan = fs::path(LIMN_SOURCE_DIR) / "config/plans/bench.json";

sim::World bench() {
  return sim::load_world(fs::path(LIMN_SOURCE_DIR) / "config/worlds/bench.json", marker_picture).value();
}

struct Errors {
  int count = 0;
  double rms_mm = 0, mean_mm = 0, rms_pull = 0, within_two = 0, normal_rms_deg = 0;
};

// Of the points that the camera sees on the clay itself: their distances from it along its normal.
Errors errors_on_clay(const scene::Surface& surface, const sim::World& world, std::size_t every) {
  const sim::Truth truth(world);
  const Imager& camera = world.rig.cameras[0];
  Errors e;
  for (std::size_t i = 0; i < surface.positions.size(); i += every) {
    const Vector3d p = surface.positions[i].cast<double>();
    const auto px = camera.project(p);
    const auto landing = px ? truth.landing(camera, *px) : std::nullopt;
    if (!landing || landing->object != "prototype") continue;
    const double error = landing->n_world.dot(p - landing->p_world);
    const double pull = error / surface.stddevs[i];
    const double angle = std::acos(std::min(1.0, landing->n_world.dot(surface.normals[i].cast<double>())));
    ++e.count;
    e.mean_mm += 1e3 * error;
    e.rms_mm += 1e6 * error * error;
    e.rms_pull += pull * pull;
    e.within_two += std::abs(pull) < 2;
    e.normal_rms_deg += angle * angle;
  }
  e.mean_mm /= e.count;
  e.rms_mm = std::sqrt(e.rms_mm / e.count);
  e.rms_pull = std::sqrt(e.rms_pull / e.count);
  e.within_two /= e.count;
  e.normal_rms_deg = std::sqrt(e.normal_rms_deg / e.count) * 180 / M_PI;
  return e;
}

nlohmann::json read_json(const fs::path& path) { return nlohmann::json::parse(read_file(path).value()); }

TEST(Scan, MeasuresTheVirtualDoorToATenthOfAMillimetreAndSaysSo) {
  const fs::path out = test::test_folder();
  const sim::World world = bench();
  ASSERT_TRUE(save_rig(world.rig, out / "rig").ok());
  ScanCommand command;
  command.plan = k_plan;
  command.rig = out / "rig";
  command.out = out / "scan";
  const Status done = run_scan(command);
  ASSERT_TRUE(done.ok()) << done.message();
  for (const char* name : {"points.ply", "mesh.ply"}) {
    const auto surface = scene::load_ply(out / "scan" / name);
    ASSERT_TRUE(surface.ok()) << surface.message();
    const Errors e = errors_on_clay(*surface, world, 23);
    RecordProperty(std::string(name) + " rms_mm", std::to_string(e.rms_mm));
    RecordProperty(std::string(name) + " rms_pull", std::to_string(e.rms_pull));
    EXPECT_GT(e.count, 5000);
    EXPECT_LT(e.rms_mm, 0.15);  // 0.11 measured; asked: 0.3
    EXPECT_LT(std::abs(e.mean_mm), 0.03);
    EXPECT_GT(e.rms_pull,
              0.8);  // 1.3 measured: the code's ripple between whole pixels is not all in the deviations
    EXPECT_LT(e.rms_pull, 1.5);
    EXPECT_GT(e.within_two, 0.85);
    EXPECT_LT(e.normal_rms_deg, 4);
  }
  const auto json = read_json(out / "scan/scan.json");
  EXPECT_GT(json["points"], 250000);
  EXPECT_LT(json["stddev_mm"]["median"], 0.1);
  for (const char* name : {"mesh.png", "shaded-pose00-camera0.png", "deviation-pose00-camera0.png"})
    EXPECT_TRUE(fs::exists(out / "scan" / name)) << name;
}

}  // namespace
}  // namespace limn::apps
