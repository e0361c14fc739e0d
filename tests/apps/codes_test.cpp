#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/capture.h"
#include "apps/solve.h"
#include "core/file.h"
#include "core/rig.h"
#include "sim/world.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"
#include "tracker/marker_image.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_capture.h"

// Tests each code from end to end on the virtual rig: a plan, its captures, the rig solved from them.

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using namespace test;
using Json = nlohmann::json;

constexpr double k_share = 0.375;  // scale of each device's image sides: 480 x 384 and 480 x 300 pixels
constexpr int k_poses = 6;

// The bench without its prototype, with fewer pixels.
Json small_bench() {
  Json world = empty_bench();
  world["objects"] = Json::array();
  world["room"]["lamps"][0].erase("radius_m");  // soft shadows take half of the ray tracing's time
  for (const char* list : {"cameras", "projectors"}) {
    for (Json& device : world[list]) {
      shrink(k_share, &device);
    }
  }
  return world;
}

// The results of one code.
struct Calibrated {
  Json report;
  Rig rig, truth;
  double held_out_px() const { return report["held_out"]["rms_px"]; }
  std::vector<std::string> faults() const {
    std::vector<std::string> names;
    for (const Json& fault : report["faults"]) names.push_back(fault["name"]);
    return names;
  }
};

Calibrated calibrated(const fs::path& folder, const Json& world, const Json& code) {
  Json plan = read_json(config_folder() / "plans/bench.json");
  plan.update(code);
  plan["world"] = "world.json";
  plan["board"] = "chessboard:8x5:43mm";
  plan["world_from_board"].erase(plan["world_from_board"].begin() + k_poses, plan["world_from_board"].end());
  EXPECT_TRUE(make_folder(folder).ok());
  write_json(folder / "world.json", world);
  write_json(folder / "plan.json", plan);
  const Status captured = run_capture({folder / "plan.json", folder / "captures"});
  EXPECT_TRUE(captured.ok()) << captured.message();
  const Status done = run_solve({.captures = folder / "captures", .out = folder / "rig"});
  EXPECT_TRUE(done.ok()) << done.message();
  if (!done.ok()) return {};
  return {read_json(folder / "rig/report.json"), load_rig(folder / "rig").value(),
          sim::load_world(folder / "world.json", tracker::marker_image).value().rig};
}

// RMS distance between the light of the solved projector and of the true one for the same pixels, on what the
// true camera sees at depths around the working volume's middle. The points are measured by the same camera,
// as when a prototype is lit: the solved camera says where a point is, in its own frame.
double light_apart_mm(const Rig& rig, const Rig& truth) {
  const Imager &camera = rig.cameras[0], &true_camera = truth.cameras[0];
  const Imager &projector = rig.projectors[0], &true_projector = truth.projectors[0];
  double squares = 0;
  int count = 0;
  for (double depth = 1.2; depth <= 1.5; depth += 0.1) {
    for (double v = 0.3; v <= 0.71; v += 0.1) {
      for (double u = 0.3; u <= 0.71; u += 0.1) {
        const Eigen::Vector2d px(u * camera.width, v * camera.height);
        const auto place = [&](const Imager& imager) -> Eigen::Vector3d {
          const auto ray = imager.ray(px);
          return ray->p_origin + depth / imager.lens.unproject(px)->z() * ray->d;
        };
        const Eigen::Vector3d p = place(camera), p_true = place(true_camera);
        const auto shown = projector.project(p), wanted = true_projector.project(p_true);
        const double depth_seen = (true_projector.imager_from_world * p_true).z();
        squares += (*shown - *wanted).squaredNorm() * std::pow(depth_seen / true_projector.lens.fx(), 2);
        ++count;
      }
    }
  }
  return 1e3 * std::sqrt(squares / count);
}

TEST(Codes, EachGivesARigAsGoodAsGrays) {
  const fs::path folder = test_folder();
  const Json world = small_bench();
  const Calibrated gray = calibrated(folder / "gray", world, {{"code", "gray"}});
  ASSERT_FALSE(gray.report.is_null());
  const double gray_mm = light_apart_mm(gray.rig, gray.truth);
  printf("[ codes    ] gray  held-out %.4f px, light %.3f mm off\n", gray.held_out_px(), gray_mm);
  EXPECT_EQ(gray.report["verdict"], "good");
  EXPECT_LT(gray_mm, 0.3);
  for (const char* code : {"phase", "xor"}) {
    const Calibrated one = calibrated(folder / code, world, {{"code", code}});
    ASSERT_FALSE(one.report.is_null()) << code;
    const double mm = light_apart_mm(one.rig, one.truth);
    printf("[ codes    ] %-5s held-out %.4f px, light %.3f mm off\n", code, one.held_out_px(), mm);
    EXPECT_EQ(one.report["verdict"], "good") << code;
    EXPECT_EQ(one.faults(), std::vector<std::string>()) << code;
    EXPECT_GT(one.report["decode"]["share"], 0.98) << code;
    EXPECT_LT(one.held_out_px(), 1.2 * gray.held_out_px()) << code;
    EXPECT_LT(mm, 1.2 * gray_mm) << code;
  }
}

// Phase with 3 steps, which cancels no error of the response; the response is measured on a wall.
TEST(Codes, PhaseIsDrawnByTheResponseThatASolveMeasured) {
  const fs::path folder = test_folder();
  Json world = small_bench();
  world["projectors"][0]["gamma"] = 1.5;
  world["projectors"][0]["channel_gamma"] = {1.2, 1.0, 0.85};
  world["projectors"][0]["s_curve"] = 0.3;
  Json with_wall = world;
  with_wall["objects"].push_back(
      {{"name", "wall"},
       {"rectangle_m", {2, 2}},
       {"world_from_object",
        {{"rotation_wxyz", {0.707106781, -0.707106781, 0, 0}}, {"translation_m", {0, 0.1, 0.4}}}},
       {"albedo", 0.8}});
  const Calibrated gray = calibrated(folder / "gray", with_wall, {{"response", true}});
  ASSERT_FALSE(gray.report.is_null());
  const Calibrated without =
      calibrated(folder / "without", world, {{"code", "phase"}, {"code_options", {{"steps", 3}}}});
  ASSERT_FALSE(without.report.is_null());
  const Calibrated with = calibrated(
      folder / "with", world,
      {{"code", "phase"}, {"code_options", {{"steps", 3}, {"response", "../gray/rig/response.json"}}}});
  ASSERT_FALSE(with.report.is_null());
  printf("[ response ] gamma 2.2: projector %.4f px, held-out %.4f; measured: %.4f px, held-out %.4f\n",
         without.report["devices"][1]["rms_px"].get<double>(), without.held_out_px(),
         with.report["devices"][1]["rms_px"].get<double>(), with.held_out_px());
  EXPECT_EQ(without.faults(), std::vector<std::string>{"projector_gamma"});
  EXPECT_EQ(without.report["verdict"], "usable");
  EXPECT_EQ(with.faults(), std::vector<std::string>());
  EXPECT_EQ(with.report["verdict"], "good");
  EXPECT_LT(with.report["devices"][1]["rms_px"], 0.5 * without.report["devices"][1]["rms_px"].get<double>());
}

}  // namespace
}  // namespace limn::apps
