#include "calib/surface/registration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>

#include "calib/surface/global_registration.h"
#include "calib/surface/scan_overlap.h"
#include "calib/surface/scan_size.h"
#include "sim/car_door.h"
#include "sim/truth.h"
#include "sim/world.h"
#include "tests/support/matchers.h"
#include "tests/support/meshes.h"
#include "tests/support/text.h"
#include "tests/support/worlds.h"

namespace limn::calib {
namespace {

using Eigen::Vector3d;
using namespace test;

constexpr double k_noise_m = 0.1e-3;

constexpr int k_step = 8;  // camera pixels between points

// What a scanner at the camera's position measures: one side of the door with its plates, and the room behind
// it.
std::vector<std::optional<sim::Landing>> landings(const sim::World& world) {
  const sim::Truth truth(world);
  const Imager& camera = world.rig.cameras[0];
  std::vector<std::optional<sim::Landing>> all;
  for (int y = 0; y + k_step <= camera.height; y += k_step)
    for (int x = 0; x + k_step <= camera.width; x += k_step) all.push_back(truth.landing(camera, {x, y}));
  return all;
}

// The same as a scan with noise along the rays. Columns from `first` to `last`, as shares of the image, are
// visible.
scene::ScanSurface scan_captures(const sim::World& world,
                                 const std::vector<std::optional<sim::Landing>>& landings,
                                 double first,
                                 double last,
                                 std::mt19937_64& rng) {
  const Vector3d eye = world.rig.cameras[0].imager_from_world.inverse().translation;
  const int columns = world.rig.cameras[0].width / k_step, rows = static_cast<int>(landings.size()) / columns;
  std::normal_distribution<double> noise(0, k_noise_m);
  std::vector<int> number(landings.size(), -1);
  scene::ScanSurface surface;
  for (int i = 0; i < columns * rows; ++i) {
    const auto& landing = landings[static_cast<std::size_t>(i)];
    const double share = (i % columns + 0.5) / columns;
    if (!landing || share < first || share > last) continue;
    const Vector3d d = (landing->p_world - eye).normalized();
    number[static_cast<std::size_t>(i)] = static_cast<int>(surface.positions.size());
    surface.positions.push_back((landing->p_world + noise(rng) * d).cast<float>());
    surface.normals.push_back(landing->n_world.cast<float>());
    surface.stddevs.push_back(static_cast<float>(k_noise_m * std::abs(d.dot(landing->n_world))));
  }
  const auto add = [&](int a, int b, int c) {
    std::array<std::uint32_t, 3> corners{};
    double low = 1e9, high = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto at = static_cast<std::size_t>(std::array{a, b, c}[k]);
      if (number[at] < 0) return;
      corners[k] = static_cast<std::uint32_t>(number[at]);
      low = std::min(low, (landings[at]->p_world - eye).norm());
      high = std::max(high, (landings[at]->p_world - eye).norm());
    }
    if (high - low < 0.02) surface.triangles.push_back(corners);
  };
  for (int y = 0; y + 1 < rows; ++y)
    for (int x = 0; x + 1 < columns; ++x) {
      const int i = y * columns + x;
      add(i, i + columns, i + 1);
      add(i + 1, i + columns, i + columns + 1);
    }
  return surface;
}

Pose disturbed(const Pose& pose, double turn, double slide, std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  const auto direction = [&] { return Vector3d(normal(rng), normal(rng), normal(rng)).normalized().eval(); };
  return Pose(exp_rotation(turn * direction()) * pose.rotation, pose.translation + slide * direction());
}

struct Errors {
  double rms_mm = 0, rms_deg = 0, worst_mm = 0, worst_deg = 0, pull2 = 0;
};

TEST(Align, ComesHomeFromFiftyMillimetresAndTenDegreesOffOnPartialScans) {
  auto rng = test_rng();
  const sim::World world = bench_world();
  const scene::Mesh& door = world.scene->prototype->mesh;
  const scene::MeshBvh index(door);
  const Pose truth = world.world_from_prototype;
  const auto met = landings(world);
  constexpr int k_draws = 12;
  Errors e;
  for (int draw = 0; draw < k_draws; ++draw) {
    // The whole door, or its left or right two thirds.
    const double first = draw % 3 == 1 ? 0.4 : 0, last = draw % 3 == 2 ? 0.6 : 1;
    const scene::ScanSurface scan = scan_captures(world, met, first, last, rng);
    const auto found = refined_registration(door, index, scan, disturbed(truth, 10_deg, 50_mm, rng));
    ASSERT_TRUE(found.ok()) << found.message();
    const Pose& pose = found->world_from_prototype;
    const double mm = 1e3 * (pose.translation - truth.translation).norm();
    const double deg = angle_between(pose.rotation, truth.rotation) * 180 / M_PI;
    const Vector6d off = boxminus(truth, pose);
    e.rms_mm += mm * mm / k_draws;
    e.rms_deg += deg * deg / k_draws;
    e.worst_mm = std::max(e.worst_mm, mm);
    e.worst_deg = std::max(e.worst_deg, deg);
    e.pull2 += off.dot(found->covariance.inverse() * off) / 6 / k_draws;
  }
  RecordProperty("rms_mm", std::to_string(std::sqrt(e.rms_mm)));
  RecordProperty("rms_deg", std::to_string(std::sqrt(e.rms_deg)));
  EXPECT_LT(std::sqrt(e.rms_mm), 0.05);   // 0.013 measured with 0.1 mm of noise; required: 0.3
  EXPECT_LT(std::sqrt(e.rms_deg), 0.01);  // 0.003 measured; required: 0.05
  EXPECT_GT(e.pull2, 0.4);  // the covariance states the error: 1 on average, 12 draws of 6 numbers
  EXPECT_LT(e.pull2, 2);
}

TEST(Align, FindsTheDoorFromAnyPoseWithoutAStart) {
  auto rng = test_rng();
  sim::World world = bench_world();
  const scene::Mesh& door = world.scene->prototype->mesh;
  const scene::MeshBvh index(door);
  const scene::ScanSurface scan = scan_captures(world, landings(world), 0, 1, rng);
  for (int draw = 0; draw < 3; ++draw) {
    // The whole scan is rotated and moved: the door may be anywhere.
    const Pose turned_from_world = disturbed(Pose(), 0.6 + draw * 1.2, 0.8, rng);
    scene::ScanSurface turned = scan;
    for (auto& p : turned.positions) p = (turned_from_world * p.cast<double>()).cast<float>();
    for (auto& n : turned.normals) n = (turned_from_world.rotation * n.cast<double>()).cast<float>();
    const auto found = global_registration(door, index, turned);
    ASSERT_TRUE(found.ok()) << found.message();
    EXPECT_TRUE(pose_near(found->registration.world_from_prototype,
                          turned_from_world * world.world_from_prototype, 0.05_deg, 0.3_mm));
  }
}

// A calibration with a board of a wrong size makes scans that are too large or too small.
TEST(Align, SaysHowLargeTheScanIs) {
  auto rng = test_rng();
  const sim::World world = bench_world();
  const scene::Mesh& door = world.scene->prototype->mesh;
  const scene::MeshBvh index(door);
  const auto met = landings(world);
  for (const double ratio : {1.0, 0.995, 1.01, 1.04}) {
    scene::ScanSurface scan = scan_captures(world, met, 0, 1, rng);
    for (auto& p : scan.positions) p *= static_cast<float>(ratio);
    const auto pose =
        refined_registration(door, index, scan, disturbed(world.world_from_prototype, 2_deg, 10_mm, rng));
    ASSERT_TRUE(pose.ok()) << pose.message();
    const auto size = scan_size(door, index, scan, *pose);
    ASSERT_TRUE(size.ok()) << size.message();
    EXPECT_NEAR(size->ratio, ratio, 3.5 * size->stddev + 1e-5);
    EXPECT_LT(size->stddev, 5e-4);
    EXPECT_EQ(contradicts(*size), ratio != 1.0);
  }
}

// The scan shows the door's front and the room behind it.
TEST(Align, SaysHowMuchOfScanAndMeshLieOnEachOther) {
  auto rng = test_rng();
  const sim::World world = bench_world();
  const scene::Mesh& door = world.scene->prototype->mesh;
  const scene::MeshBvh index(door);
  const auto met = landings(world);
  const Overlap whole =
      overlap(door, index, scan_captures(world, met, 0, 1, rng), world.world_from_prototype);
  EXPECT_GT(whole.mesh_share, 0.25);
  EXPECT_LT(whole.mesh_share, 0.6) << "the back of the door is not seen";
  EXPECT_TRUE(check_overlap(whole));
  // A part of the door alone: little of the mesh, but all of the scan.
  scene::ScanSurface detail = scan_captures(world, met, 0.45, 0.55, rng);
  const Pose prototype_from_world = world.world_from_prototype.inverse();
  std::vector<bool> is_door;
  for (const auto& p : detail.positions)
    is_door.push_back(index.nearest(prototype_from_world * p.cast<double>(), 2_mm).has_value());
  detail = scene::with_vertices_kept(detail, is_door);
  const Overlap part = overlap(door, index, detail, world.world_from_prototype);
  EXPECT_GT(part.scan_share, 0.95);
  EXPECT_LT(part.mesh_share, 0.25);
  EXPECT_TRUE(check_overlap(part));
}

// A vase as large as the door.
TEST(Align, RefusesAnotherObject) {
  auto rng = test_rng();
  const sim::World world = bench_world();
  const scene::ScanSurface scan = scan_captures(world, landings(world), 0, 1, rng);
  const scene::Mesh vase = test::grid(60, 60, [](double u, double v) {
    const double radius = 0.15 + 0.06 * std::sin(9 * v), angle = -2 * M_PI * u;
    return Vector3d(radius * std::cos(angle), radius * std::sin(angle), 0.6 * v);
  });
  const scene::MeshBvh index(vase);
  const auto found = global_registration(vase, index, scan);
  if (!found) return;  // the search has refused it already
  const Overlap shares = overlap(vase, index, scan, found->registration.world_from_prototype);
  EXPECT_FALSE(check_overlap(shares)) << shares.scan_share << " " << shares.mesh_share;
  test::expect_contains(check_overlap(shares).message(), "Is this the CAD of the scanned object?");
}

// A square plate in the plane z = 0 of the world, 0.2 m wide, a point every 4 mm, `bump` m higher in a disc
// of 2 cm around (0.05, 0.02).
scene::ScanSurface plate(double bump) {
  constexpr int k_side = 51;
  scene::ScanSurface surface;
  for (int y = 0; y < k_side; ++y)
    for (int x = 0; x < k_side; ++x) {
      const Vector3d p(0.004 * x - 0.1, 0.004 * y - 0.1, 0);
      const bool raised = (p - Vector3d(0.05, 0.02, 0)).norm() < 0.02;
      surface.positions.emplace_back((p + Vector3d(0, 0, raised ? bump : 0)).cast<float>());
      surface.normals.emplace_back(0.f, 0.f, 1.f);
      const auto i = static_cast<std::uint32_t>(y * k_side + x);
      if (x + 1 == k_side || y + 1 == k_side) continue;
      surface.triangles.push_back({i, i + 1, i + k_side});
      surface.triangles.push_back({i + 1, i + k_side + 1, i + k_side});
    }
  return surface;
}

TEST(Align, NamesWhatAFlatShapeDoesNotHold) {
  const scene::Mesh mesh = scene::mesh_of(plate(0));
  const scene::MeshBvh index(mesh);
  const Pose start(exp_rotation({0.02, -0.01, 0}), {0, 0, 0.004});
  const auto found = refined_registration(mesh, index, plate(0), start);
  ASSERT_TRUE(found.ok()) << found.message();
  auto names = found->free_directions;
  std::sort(names.begin(), names.end());
  ASSERT_EQ(names.size(), 3U);
  EXPECT_EQ(names[0].substr(0, 11), "slide along");
  EXPECT_EQ(names[1].substr(0, 11), "slide along");
  EXPECT_EQ(names[2], "turn about z");
  // The determined direction is right.
  EXPECT_NEAR((found->world_from_prototype * Vector3d(0.03, 0.02, 0)).z(), 0, 1e-6);
  EXPECT_GT(found->covariance(3, 3), 0.1);  // the free direction is stated as unknown
}

TEST(Align, TellsWhereAndHowFarTheScanDiffers) {
  const scene::Mesh mesh = scene::mesh_of(plate(0));
  const scene::MeshBvh index(mesh);
  const scene::ScanSurface scan = plate(-2.5e-3);
  Registration home;
  const auto off = residuals(index, scan, home, 0.02);
  const auto found = differences(scan, off, home);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].mean_m, -2.5e-3, 1e-6);
  EXPECT_NEAR(found[0].area_m2, M_PI * 0.02 * 0.02, 0.25 * M_PI * 0.02 * 0.02);
  EXPECT_TRUE(test::near(found[0].p_prototype.head<2>(), Eigen::Vector2d(0.05, 0.02), 1_mm));
  home.covariance = Matrix6d::Identity() * 1e-6;  // a millimetre: the dent is within four of them
  EXPECT_TRUE(differences(scan, off, home).empty());
}

TEST(Align, PicksGiveThePoseOrSayWhichOneIsWrong) {
  auto rng = test_rng();
  const Pose truth = disturbed(Pose(), 2, 0.7, rng);
  std::vector<Pick> picks;
  for (const Vector3d& p :
       {Vector3d(0, 0, 0), Vector3d(0.5, 0, 0), Vector3d(0, 0.3, 0), Vector3d(0.1, 0.1, 0.1)})
    picks.push_back({p, truth * p});
  const auto pose = pose_from_picks(picks);
  ASSERT_TRUE(pose.ok()) << pose.message();
  EXPECT_TRUE(pose_near(*pose, truth, 1e-6_deg, 1e-6_mm));
  picks[2].p_world.x() += 0.4;
  EXPECT_NE(pose_from_picks(picks).message().find("pair 2"), std::string::npos);
  EXPECT_NE(pose_from_picks({picks[0], picks[1]}).message().find("at least 3"), std::string::npos);
  const Pick between{0.5 * (picks[0].p_prototype + picks[1].p_prototype),
                     0.5 * (picks[0].p_world + picks[1].p_world)};
  EXPECT_NE(pose_from_picks({picks[0], picks[1], between}).message().find("one line"), std::string::npos);
}

TEST(Align, SaysThatTheUnitsAreWrong) {
  scene::Mesh mesh = scene::mesh_of(plate(0));
  for (auto& p : mesh.positions) p *= 1000;
  const Status sizes = comparable_sizes(mesh, plate(0));
  ASSERT_FALSE(sizes.ok());
  EXPECT_NE(sizes.message().find("1000 times larger"), std::string::npos) << sizes.message();
  EXPECT_NE(sizes.message().find("--units"), std::string::npos);
  EXPECT_TRUE(comparable_sizes(scene::mesh_of(plate(0)), plate(0)).ok());
}

}  // namespace
}  // namespace limn::calib
