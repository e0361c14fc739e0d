#include "apps/deviation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <vector>

#include "apps/scan.h"
#include "core/config.h"
#include "core/file.h"
#include "core/rig.h"
#include "scene/meshes/scan_surface.h"
#include "sim/truth.h"
#include "sim/virtual_rig.h"
#include "tests/calib/scanned_panel.h"
#include "tests/support/bumped_door.h"
#include "tests/support/matchers.h"
#include "tests/support/meshes.h"
#include "tests/support/text.h"
#include "tests/support/worlds.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using calib::DeviationState;
using Eigen::Vector3d;
using test::box_object;
using test::bumped;
using test::door_height;

const fs::path k_plan = test::config_folder() / "plans/bench.json",
               k_door = test::config_folder() / "scenes/door/door.glb";

// The virtual rig scans the door with bumps, dents and a hand on it, once.
class DoorDeviation : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    out_ = test::test_folder();
    world_ = test::bench_world();
    cad_ = world_->scene->prototype->mesh;
    ASSERT_TRUE(save_rig(world_->rig, out_ / "rig").ok());
    sim::World world = test::bench_world();
    std::erase_if(world.objects,
                  [](const sim::Object& object) { return object.name.starts_with("marker-"); });
    std::erase_if(world.markers, [](const sim::PlacedMarker&) { return true; });
    world.find("prototype")->mesh = std::make_shared<const scene::Mesh>(bumped(cad_));
    const Pose& door = world.world_from_prototype;
    world.objects.push_back(
        box_object("palm", door * Pose(Eigen::Quaterniond::Identity(), k_palm), {0.04, 0.03, 0.01}));
    world.objects.push_back(
        box_object("finger", door * Pose(Eigen::Quaterniond::Identity(), k_finger), {0.008, 0.045, 0.03}));
    world_->objects = world.objects;
    const auto plan = wizard::load_plan(k_plan);
    ASSERT_TRUE(plan.ok()) << plan.message();
    {
      sim::VirtualRig rig(std::move(world));
      ASSERT_TRUE(
          wizard::capture_prototype(*plan, {rig.world().world_from_prototype}, &rig, out_ / "captures").ok());
    }
    ScanCommand scan;
    scan.captures = out_ / "captures";
    scan.rig = out_ / "rig";
    scan.far_m = 1.75;  // in front of the wall
    scan.out = out_ / "scan";
    const Status done = run_scan(scan);
    ASSERT_TRUE(done.ok()) << done.message();
  }
  static void TearDownTestSuite() { world_.reset(); }

  // From a pose as a tracker may state it, a millimetre and a tenth of a degree off.
  static DeviationCommand command(const fs::path& out) {
    const Pose truth = world_->world_from_prototype;
    const Pose start(exp_rotation({0.002, -0.002, 0.002}) * truth.rotation,
                     truth.translation + Vector3d(1e-3, -1e-3, 1e-3));
    DeviationCommand command;
    command.files.align.scan = out_ / "scan";
    command.files.align.mesh = k_door;
    command.files.align.start =
        test::write_json(out / "start.json", {{"world_from_prototype", to_json(start)}});
    command.files.align.out = out / "deviation";
    return command;
  }

  static inline const Vector3d k_palm = {0.0, 0.09, 0.14}, k_finger = {-0.15, -0.05, 0.09};
  static inline fs::path out_;
  static inline std::optional<sim::World> world_;
  static inline scene::Mesh cad_;
};

TEST_F(DoorDeviation, IsTheClayThatWasAddedOrTakenAway) {
  const DeviationCommand with = command(test::test_folder());
  wizard::DeviationFilesOptions options = with.files;
  const auto report = wizard::write_deviation(options);
  ASSERT_TRUE(report.ok()) << report.message();
  const calib::Deviation& found = report->deviation;
  const sim::Truth truth(*world_);
  const Pose& world_from_door = world_->world_from_prototype;
  int count = 0, large = 0, right = 0, invented = 0, hidden = 0;
  double squares = 0, pulls = 0, sum = 0;
  for (std::size_t i = 0; i < found.states.size(); ++i) {
    if (found.cad.surface.normals[i].z() < 0.3f) continue;
    const Vector3d p = found.cad.surface.positions[i].cast<double>(),
                   n = found.cad.surface.normals[i].cast<double>();
    const double height = door_height(p);
    // 0.05 mm before the clay, so that its own triangles do not hide it.
    const Vector3d p_clay = world_from_door * Vector3d(p + (height + 5e-5) * n);
    const bool is_seen =
        truth.visible(world_->rig.cameras[0], p_clay) && truth.visible(world_->rig.projectors[0], p_clay);
    hidden += !is_seen;
    if (!found.has(i)) continue;
    invented += !is_seen;
    const double off = static_cast<double>(found.distances_m[i]) - height;
    ++count;
    sum += off;
    squares += off * off;
    pulls += std::pow(off / static_cast<double>(found.stddevs_m[i]), 2);
    if (std::abs(height) < 0.3e-3) continue;
    ++large;
    right += static_cast<double>(found.distances_m[i]) * height > 0;
  }
  const double rms_mm = 1e3 * std::sqrt(squares / count), pull = std::sqrt(pulls / count);
  printf(
      "[ deviation ] %.3f mm RMS (mean %.3f), pulls %.2f (noise factor %.2f), right sign %.2f %% of %d, %d "
      "of %d hidden points invented; %zu points\n",
      rms_mm, 1e3 * sum / count, pull, found.noise_factor, 100.0 * right / large, large, invented, hidden,
      found.states.size());
  EXPECT_GT(count, 20000);
  EXPECT_GT(large, 1000);
  EXPECT_LT(rms_mm, 0.15);
  EXPECT_NEAR(pull, 1, 0.2);
  EXPECT_GT(right, 0.99 * large);
  EXPECT_GT(hidden, 2000);
  EXPECT_LT(invented, 0.01 * hidden);
}

TEST_F(DoorDeviation, HasAPageAndTables) {
  DeviationCommand with = command(test::test_folder());
  with.tolerance_mm = 0.4;
  const Status done = run_deviation(with);
  ASSERT_TRUE(done.ok()) << done.message();
  const fs::path& out = with.files.align.out;
  const auto json = test::read_json(out / "deviation.json");
  EXPECT_EQ(json["schema"], "limn.deviation/1");
  EXPECT_EQ(json["tolerance_mm"], 0.4);
  EXPECT_TRUE(json["alignment"]["free_directions"].empty());
  EXPECT_NEAR(json["highest_mm"].get<double>(), 3, 0.4);
  EXPECT_NEAR(json["lowest_mm"].get<double>(), -3, 0.4);
  ASSERT_GE(json["extremes"].size(), 5U);
  const Pose pose = test::pose_of(json["alignment"]["world_from_prototype"]);
  using namespace test::literals;
  EXPECT_TRUE(test::pose_near(pose, world_->world_from_prototype, 0.03_deg, 0.15_mm));
  const std::string page = read_file(out / "deviation.html").value();
  for (const char* part : {"<img", "not measured", "0.4 to 0.8 mm", "<svg", "-3."})
    test::expect_contains(page, part);
  EXPECT_EQ(page.find("http"), std::string::npos) << "the page is one file";
  const auto ply = scene::load_ply(out / "deviation.ply");
  ASSERT_TRUE(ply.ok()) << ply.message();
  const std::string csv = read_file(out / "deviation.csv").value();
  EXPECT_EQ(static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')), ply->positions.size() + 1);
  for (const char* part : {",measured\n", ",not_measured\n"}) test::expect_contains(csv, part);

  DeviationCommand strict = with;
  strict.files.align.out = out.parent_path() / "strict";
  strict.tolerance_mm = 0.1;  // below two standard deviations of the worst points
  const Status again = run_deviation(strict);
  ASSERT_TRUE(again.ok()) << again.message();
  test::expect_contains(read_file(strict.files.align.out / "deviation.csv").value(), ",uncertain\n");
}

// The handle's region alone; then the pose that was found, which is trusted with its covariance.
TEST_F(DoorDeviation, IsFittedLocallyOrNotAtAll) {
  const fs::path own = test::test_folder();
  DeviationCommand with = command(own);
  with.fit_mm = {200, 150, 100, 20, -150, -50};
  const Status done = run_deviation(with);
  ASSERT_TRUE(done.ok()) << done.message();
  const auto fitted = test::read_json(with.files.align.out / "deviation.json");
  EXPECT_NEAR(fitted["alignment"]["fit_box_m"][0][0].get<double>(), 0.02, 1e-9);

  with.files.align.start = test::write_json(own / "given.json", fitted["alignment"]);
  with.files.align.out = own / "given";
  with.fit_mm.clear();
  with.no_align = true;
  const Status trusted = run_deviation(with);
  ASSERT_TRUE(trusted.ok()) << trusted.message();
  const auto given = test::read_json(own / "given/deviation.json");
  EXPECT_EQ(given["alignment"]["start"], "given");
  EXPECT_EQ(given["alignment"]["covariance"], fitted["alignment"]["covariance"]);
  EXPECT_NEAR(given["rms_mm"].get<double>(), fitted["rms_mm"].get<double>(), 1e-3);
  with.fit_mm = {500, 500, 500, 600, 600, 600};
  with.no_align = false;
  with.files.align.out = own / "none";
  const Status empty = run_deviation(with);
  ASSERT_FALSE(empty.ok());
  test::expect_contains(empty.message(), "--fit");
  EXPECT_FALSE(fs::exists(own / "none"));
}

TEST_F(DoorDeviation, RefusesOtherUnitsAnotherObjectAndNoCad) {
  const fs::path own = test::test_folder();
  DeviationCommand with = command(own);
  with.files.align.units = scene::LengthUnit::millimetre;
  test::expect_contains(run_deviation(with).message(), "check --units");

  const scene::Mesh vase = test::grid(60, 60, [](double u, double v) {
    const double radius = 0.15 + 0.06 * std::sin(9 * v), angle = -2 * M_PI * u;
    return Vector3d(radius * std::cos(angle), radius * std::sin(angle), 0.6 * v);
  });
  scene::ScanSurface other;
  other.positions = vase.positions;
  other.triangles = vase.triangles;
  ASSERT_TRUE(scene::save_ply(other, own / "vase.ply").ok());
  with = command(own);
  with.files.align.mesh = own / "vase.ply";
  with.files.align.units = scene::LengthUnit::metre;
  const Status another = run_deviation(with);
  ASSERT_FALSE(another.ok());

  with = command(own);
  nlohmann::json scene_file = test::read_json(world_->scene->folder / "scene.json");
  scene_file.erase("prototype");
  fs::copy(world_->scene->folder, own / "bare", fs::copy_options::recursive);
  test::write_json(own / "bare/scene.json", scene_file);
  with.files.align.mesh.clear();
  with.files.align.scene = own / "bare";
  test::expect_contains(run_deviation(with).message(), "expected a prototype");
  EXPECT_FALSE(fs::exists(with.files.align.out));
}

// A panel's CAD and its scan, whose size is `size` times the CAD's, as files of `folder`; they are aligned.
DeviationCommand panel_command(const fs::path& folder,
                               const test::PanelShape& shape,
                               const std::vector<test::Bump>& bumps,
                               double size) {
  auto rng = test::test_rng();
  const scene::Mesh mesh = test::panel_mesh(shape, 60, 40);
  scene::ScanSurface cad, scan = test::scan_of_panel(shape, bumps, {.spacing_m = 2e-3}, rng);
  cad.positions = mesh.positions;
  cad.triangles = mesh.triangles;
  for (Eigen::Vector3f& p : scan.positions) p *= static_cast<float>(size);
  EXPECT_TRUE(scene::save_ply(cad, folder / "cad.ply").ok());
  EXPECT_TRUE(scene::save_ply(scan, folder / "scan.ply").ok());
  DeviationCommand command;
  command.files.align.scan = folder / "scan.ply";
  command.files.align.mesh = folder / "cad.ply";
  command.files.align.units = scene::LengthUnit::metre;
  command.files.align.start =
      test::write_json(folder / "start.json", {{"world_from_prototype", to_json(Pose())}});
  command.files.align.out = folder / "out";
  return command;
}

// A pose from limn align says which directions are free; the flanks of a bump are unsure as with a fit.
TEST(DeviationFiles, APoseThatIsTrustedMaySlide) {
  const fs::path own = test::test_folder();
  DeviationCommand command = panel_command(own, test::flat, {{0, 0, 0.02, 3e-3}}, 1);
  wizard::AlignOptions align = command.files.align;
  align.out = own / "aligned";
  ASSERT_TRUE(wizard::align_scan(align).ok());
  command.files.align.start = own / "aligned/align.json";
  command.no_align = true;
  const Status done = run_deviation(command);
  ASSERT_TRUE(done.ok()) << done.message();
  const auto json = test::read_json(own / "out/deviation.json");
  EXPECT_EQ(json["alignment"]["free_directions"].size(), 3U);
  EXPECT_GT(json["areas_cm2"]["uncertain"].get<double>(), 3);
  EXPECT_GT(json["areas_cm2"]["measured"].get<double>(), 400) << "the plain part is sure";
  test::expect_contains(json["warnings"].dump(), "hatched");
}

TEST(DeviationFiles, TellOfAScanOfAnotherSize) {
  const fs::path own = test::test_folder();
  const DeviationCommand command = panel_command(own, test::shaped, {}, 1.01);
  const Status done = run_deviation(command);
  ASSERT_TRUE(done.ok()) << done.message();
  test::expect_contains(test::read_json(own / "out/deviation.json")["warnings"].dump(), "times as large");
}

TEST(DeviationOptions, AreCheckedFirst) {
  DeviationCommand command;
  command.files.align.mesh = k_door;
  command.files.align.scan = "scan";
  command.files.align.out = test::test_folder() / "out";
  command.no_align = true;
  EXPECT_TRUE(run_deviation(command).error().wrong_usage);  // without a pose
  command.no_align = false;
  command.reach_mm = 0.3;
  EXPECT_TRUE(run_deviation(command).error().wrong_usage);  // below the tolerance
  command.reach_mm = 5;
  command.fit_mm = {1, 2, 3};
  EXPECT_TRUE(run_deviation(command).error().wrong_usage);
  EXPECT_FALSE(fs::exists(command.files.align.out));
}

}  // namespace
}  // namespace limn::apps
