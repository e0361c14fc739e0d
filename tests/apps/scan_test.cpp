#include "apps/scan.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/align.h"
#include "core/config.h"
#include "core/rig.h"
#include "scene/marker_file.h"
#include "scene/meshes/mesh_bvh.h"
#include "scene/meshes/scan_surface.h"
#include "scene/posed_scene.h"
#include "sim/truth.h"
#include "sim/world.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"
#include "tests/support/worlds.h"
#include "wizard/capture/capture_plan.h"
#include "wizard/capture/virtual_capture.h"

namespace limn::apps {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using namespace test::literals;

const fs::path k_plan = test::config_folder() / "plans/bench.json",
               k_door = test::config_folder() / "scenes/door/door.glb";

struct Errors {
  int count = 0;
  double rms_mm = 0, mean_mm = 0, rms_pull = 0, within_two = 0, normal_rms_deg = 0;
};

// The distances along the normal from the clay, for the points where the camera sees the clay itself.
Errors errors_on_clay(const scene::ScanSurface& surface, const sim::World& world, std::size_t every) {
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

// The virtual door, scanned once with the true rig.
class DoorScan : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    out_ = test::test_folder();
    world_ = test::bench_world();
    ASSERT_TRUE(save_rig(world_->rig, out_ / "rig").ok());
    ScanCommand command;
    command.plan = k_plan;
    command.rig = out_ / "rig";
    command.out = out_ / "scan";
    const Status done = run_scan(command);
    ASSERT_TRUE(done.ok()) << done.message();
  }
  static void TearDownTestSuite() { world_.reset(); }

  // Lays the CAD mesh onto the scan, from a pose that is off by centimetres.
  static AlignCommand align_command(const fs::path& out) {
    const Pose truth = world_->world_from_prototype;
    const Pose start(exp_rotation({0.1, -0.1, 0.1}) * truth.rotation,
                     truth.translation + Vector3d(0.03, -0.03, 0.026));
    AlignCommand align;
    align.scan = out_ / "scan";
    align.mesh = k_door;
    align.units = scene::LengthUnit::metre;
    align.start = test::write_json(out / "start.json", {{"world_from_prototype", to_json(start)}});
    align.out = out / "aligned";
    return align;
  }

  // The message of scanning the same captures with another rig.
  static std::string refusal_of(const Rig& rig, const fs::path& out) {
    EXPECT_TRUE(save_rig(rig, out / "rig").ok());
    ScanCommand command;
    command.captures = out_ / "scan/captures";
    command.rig = out / "rig";
    command.out = out / "scan";
    const Status scanned = run_scan(command);
    EXPECT_FALSE(scanned.ok());
    EXPECT_FALSE(fs::exists(command.out));
    return scanned.ok() ? "" : scanned.message();
  }

  static inline fs::path out_;
  static inline std::optional<sim::World> world_;
};

TEST_F(DoorScan, IsWithinATenthOfAMillimetreOfTheClay) {
  for (const char* name : {"points.ply", "mesh.ply"}) {
    const auto surface = scene::load_ply(out_ / "scan" / name);
    ASSERT_TRUE(surface.ok()) << surface.message();
    const Errors e = errors_on_clay(*surface, *world_, 23);
    printf("[ scan     ] %s: %.3f mm RMS off the clay, pulls %.2f\n", name, e.rms_mm, e.rms_pull);
    EXPECT_GT(e.count, 5000);
    EXPECT_LT(e.rms_mm, 0.15);  // 0.09 measured; required: 0.3
    EXPECT_LT(std::abs(e.mean_mm), 0.03);
    EXPECT_GT(e.rms_pull,
              0.8);  // 1.3 measured: the standard deviations do not contain all of the code's ripple between
                     // whole pixels
    EXPECT_LT(e.rms_pull, 1.5);
    EXPECT_GT(e.within_two, 0.85);
    EXPECT_LT(e.normal_rms_deg, 4);
  }
}

// The patterns of the columns alone, under another program's names, and no board: as SLStudio and others
// capture.
TEST_F(DoorScan, OfImportedColumnsAloneIsTheSameSurface) {
  const fs::path own = test::test_folder();
  const fs::path captured = out_ / "scan/captures/pose00/camera0";
  fs::create_directories(own / "photos/scene_1");
  constexpr int k_columns = 22, k_white = 42;  // 11 bits with inverses; white and black are the last of 44
  for (int i = 0; i < k_columns; ++i)
    fs::create_symlink(captured / fmt::format("{:03}.png", i),
                       own / fmt::format("photos/scene_1/img{}.png", i + 2));
  for (int i = 0; i < 2; ++i)
    fs::create_symlink(captured / fmt::format("{:03}.png", k_white + i),
                       own / fmt::format("photos/scene_1/img{}.png", i));
  ScanCommand command;
  command.captures = own / "photos";
  command.rig = out_ / "rig";
  command.out = own / "scan";
  command.poses = {"scene_*"};
  command.foreign = {.import_format = wizard::ImportFormat::opencv_gray, .projector = "1280x800"};
  const Status done = run_scan(command);
  ASSERT_TRUE(done.ok()) << done.message();
  const auto surface = scene::load_ply(own / "scan/points.ply");
  ASSERT_TRUE(surface.ok()) << surface.message();
  const Errors e = errors_on_clay(*surface, *world_, 23);
  printf("[ scan     ] columns alone: %.3f mm RMS off the clay\n", e.rms_mm);
  EXPECT_GT(e.count, 5000);
  EXPECT_LT(e.rms_mm, 0.3);
  EXPECT_LT(std::abs(e.mean_mm), 0.05);
}

TEST_F(DoorScan, ReportsItsPointsAndDrawsThem) {
  const auto json = test::read_json(out_ / "scan/scan.json");
  EXPECT_GT(json["points"], 250000);
  EXPECT_LT(json["stddev_mm"]["median"], 0.1);
  for (const char* name : {"mesh.png", "shaded-pose00-camera0.png", "deviation-pose00-camera0.png"})
    EXPECT_TRUE(fs::exists(out_ / "scan" / name)) << name;
}

TEST_F(DoorScan, TheCadIsLaidOntoIt) {
  const AlignCommand align = align_command(test::test_folder());
  const Status laid = run_align(align);
  ASSERT_TRUE(laid.ok()) << laid.message();
  const auto posed = scene::load_poses(align.out / "poses.json", *world_->scene);
  ASSERT_TRUE(posed.ok()) << posed.message();
  EXPECT_TRUE(test::pose_near(*posed->world_from_prototype, world_->world_from_prototype, 0.05_deg, 0.3_mm));
  const auto report = test::read_json(align.out / "align.json");
  EXPECT_TRUE(report["free_directions"].empty());
  EXPECT_GE(report["differences"].size(),
            4U);  // the plates of the markers, up to 3 mm above the clay
  for (const auto& difference : report["differences"]) {
    EXPECT_GT(difference["mean_mm"], 0);
    EXPECT_LT(difference["worst_mm"], 5);
  }
  for (const char* name : {"residual.ply", "residual.png", "residual-side.png"})
    EXPECT_TRUE(fs::exists(align.out / name)) << name;
}

// The door's markers as a learned body, in the frame of one of them: they are found on the CAD mesh, and a
// scene that names their file is the same scene.
TEST_F(DoorScan, MarkersOfALearnedBodyAreFoundOnTheCad) {
  const fs::path out = test::test_folder();
  const std::vector<BodyMarker>& on_door = world_->scene->prototype->markers;
  nlohmann::json body = {{"schema", "limn.body/1"}, {"markers", nlohmann::json::array()}};
  for (const BodyMarker& marker : on_door)
    body["markers"].push_back(
        {{"name", marker.marker.text()},
         {"size_mm", 1e3 * marker.size_m},
         {"body_from_marker", to_json(on_door[2].body_from_marker.inverse() * marker.body_from_marker)}});
  const calib::CaptureSet captures = calib::load_captures(out_ / "scan/captures").value();
  AlignCommand align = align_command(out);
  align.body = test::write_json(out / "body.json", body);
  align.rig = out_ / "rig";
  align.frames = {"camera0=" + captures.poses[0].images[0][0][captures.patterns[0].white()].string()};
  const Status with_body = run_align(align);
  ASSERT_TRUE(with_body.ok()) << with_body.message();
  const auto found = scene::load_marker_file(align.out / "markers.json");
  ASSERT_TRUE(found) << found.message();
  ASSERT_EQ(found->size(), on_door.size());
  for (std::size_t i = 0; i < on_door.size(); ++i)
    EXPECT_TRUE(test::pose_near((*found)[i].body_from_marker, on_door[i].body_from_marker, 0.1_deg, 0.5_mm))
        << on_door[i].marker.text();

  const fs::path project = out / "project";
  fs::copy(world_->scene->folder, project, fs::copy_options::recursive);
  fs::copy_file(align.out / "markers.json", project / "markers.json");
  nlohmann::json file = test::read_json(project / "scene.json");
  file["prototype"]["markers"] = "markers.json";
  test::write_json(project / "scene.json", file);
  const auto same = scene::load_scene(project);
  ASSERT_TRUE(same) << same.message();
  EXPECT_EQ(same->prototype->markers.size(), on_door.size());
  file["prototype"]["markers"] = "none.json";
  test::write_json(project / "scene.json", file);
  test::expect_contains(scene::load_scene(project).message(), "none.json");
}

TEST_F(DoorScan, ACadInOtherUnitsIsRefused) {
  AlignCommand align = align_command(test::test_folder());
  align.start.clear();
  align.units = scene::LengthUnit::millimetre;
  const Status wrong = run_align(align);
  ASSERT_FALSE(wrong.ok());
  test::expect_contains(wrong.message(), "check --units");
  EXPECT_FALSE(fs::exists(align.out));
}

TEST_F(DoorScan, AProjectorOfAnotherSizeIsNamed) {
  Rig other = world_->rig;
  other.projectors[0].width = 1920;
  const std::string message = refusal_of(other, test::test_folder());
  test::expect_contains(message, "projector0");
  test::expect_contains(message, "1920x800");
}

TEST_F(DoorScan, AProjectorThatWasTurnedByTwoDegreesIsNoticed) {
  Rig other = world_->rig;
  other.projectors[0].imager_from_world =
      Pose(exp_rotation({0.035, 0, 0}), Vector3d::Zero()) * other.projectors[0].imager_from_world;
  test::expect_contains(refusal_of(other, test::test_folder()), "moved since");
}

TEST(Scan, LaysPosesOfAMovedPrototypeOntoEachOtherWhenTold) {
  const fs::path out = test::test_folder();
  const sim::World world = test::bench_world();
  ASSERT_TRUE(save_rig(world.rig, out / "rig").ok());
  const Pose home = world.world_from_prototype;
  const Pose elsewhere(exp_rotation({0.02, 0.05, 0.24}) * home.rotation,
                       home.translation + Vector3d(0.07, -0.05, 0.02));
  {
    const wizard::Plan plan = wizard::load_plan(k_plan).value();
    sim::VirtualRig rig(test::bench_world());
    ASSERT_TRUE(wizard::capture_prototype(plan, {home, elsewhere}, &rig, out / "captures").ok());
  }
  ScanCommand command;
  command.captures = out / "captures";
  command.rig = out / "rig";
  command.out = out / "scan";
  command.far_m = 1.75;  // in front of the wall
  const Status refused = run_scan(command);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.message().find("--moved"), std::string::npos) << refused.message();
  EXPECT_FALSE(fs::exists(command.out));
  command.moved = true;
  const Status done = run_scan(command);
  ASSERT_TRUE(done.ok()) << done.message();
  const auto json = test::read_json(command.out / "scan.json");
  const Pose first_from_pose = test::pose_of(json["views"][1]["first_from_pose"]);
  EXPECT_TRUE(test::pose_near(first_from_pose * elsewhere, home, 0.05_deg, 0.3_mm));
  EXPECT_LT(json["views_agree"]["rms_mm"], 0.3);
  const auto mesh = scene::load_ply(command.out / "mesh.ply");
  ASSERT_TRUE(mesh.ok()) << mesh.message();
  const Errors e = errors_on_clay(*mesh, world, 23);
  RecordProperty("rms_mm", std::to_string(e.rms_mm));
  EXPECT_GT(e.count, 3000);
  EXPECT_LT(e.rms_mm, 0.2);  // required: 0.3
}

TEST(Scan, CallsWrongOptionsWrongUsage) {
  ScanCommand command;
  command.rig = test::test_folder();
  command.out = command.rig / "out";
  Status status = run_scan(command);
  ASSERT_FALSE(status.ok());
  EXPECT_TRUE(status.error().wrong_usage);  // neither captures nor a plan
  command.captures = command.rig;
  command.near_m = 2;
  command.far_m = 1;
  status = run_scan(command);
  ASSERT_FALSE(status.ok());
  EXPECT_TRUE(status.error().wrong_usage);
  EXPECT_FALSE(fs::exists(command.out));
}

TEST(Align, CallsWrongOptionsWrongUsage) {
  AlignCommand command;
  command.mesh = k_door;
  command.units = scene::LengthUnit::metre;
  command.out = test::test_folder() / "out";
  EXPECT_TRUE(run_align(command).error().wrong_usage);  // neither a scan nor markers
  command.scan = "scan.ply";
  command.mesh = "door.obj";  // this format states no unit
  command.units.reset();
  EXPECT_TRUE(run_align(command).error().wrong_usage);
  command.mesh = k_door;
  command.units = scene::LengthUnit::metre;
  command.start = "a.json";
  command.points = "b.json";
  EXPECT_TRUE(run_align(command).error().wrong_usage);
  EXPECT_FALSE(fs::exists(command.out));
}

}  // namespace
}  // namespace limn::apps
