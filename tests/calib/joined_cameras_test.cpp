// Rigs whose cameras see no board together.
#include <gtest/gtest.h>

#include "calib/judge/error_map.h"
#include "calib/judge/uncertainty.h"
#include "calib/solve.h"
#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace limn::calib::worlds;

// Even poses are seen by camera 0 alone, odd ones by camera 1 alone.
World apart_world(int projectors, int poses) {
  World world = make_world(2, projectors, poses, 0.5);
  const auto is_other = [](const auto& seen) { return seen.camera != seen.pose % 2; };
  std::erase_if(world.observations.corners, is_other);
  std::erase_if(world.observations.matches, is_other);
  return world;
}

// Each projector's light is seen by the camera of its number alone.
void keep_own_light(World* world) {
  std::erase_if(world->observations.matches,
                [](const Match& match) { return match.camera != match.projector; });
}

// Half a pixel is what seven boards of each camera allow.
void expect_truth(const Rig& found, const Rig& truth, double px) {
  for (const auto devices : {&Rig::cameras, &Rig::projectors}) {
    ASSERT_EQ((found.*devices).size(), (truth.*devices).size());
    for (size_t i = 0; i < (truth.*devices).size(); ++i) {
      for (const double z : {0.95, 1.25}) {
        for (const Eigen::Vector2d& xy : {Eigen::Vector2d(0, 0), {-0.12, 0.08}, {0.12, -0.08}}) {
          const Eigen::Vector3d p(xy.x(), xy.y(), z);
          const auto a = (found.*devices)[i].project(p), b = (truth.*devices)[i].project(p);
          ASSERT_TRUE(a && b);
          EXPECT_LT((*a - *b).norm(), px) << (truth.*devices)[i].name;
        }
      }
    }
  }
}

// Solves with noise, and compares with the truth.
void expect_joined(World* world) {
  add_noise(world, 0.02, 0.03, test_rng());
  const auto solution = solve(world->observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  expect_truth(solution->rig, world->rig, 0.6);
}

TEST(JoinedCameras, OneProjectorJoinsCamerasWithoutACommonBoard) {
  World world = apart_world(1, 14);
  expect_joined(&world);
}

TEST(JoinedCameras, AProjectorJoinsThatOneCameraHardlySees) {
  World world = apart_world(1, 14);
  std::erase_if(world.observations.matches,
                [](const Match& match) { return match.camera == 0 && match.pose > 0; });
  expect_joined(&world);
}

TEST(JoinedCameras, ASceneJoinsCamerasThatShareNoLightOnBoards) {
  World world = apart_world(2, 14);
  keep_own_light(&world);
  observe_scene(&world, 12, 9);
  expect_joined(&world);
}

TEST(JoinedCameras, CamerasThatNothingJoinsAreNamed) {
  World world = apart_world(2, 14);
  keep_own_light(&world);
  const auto solution = solve(world.observations);
  ASSERT_FALSE(solution.ok());
  EXPECT_NE(solution.message().find("camera1: nothing joins it with camera0"), std::string::npos)
      << solution.message();
}

// Two cameras side by side, 0.9 m apart, and a projector whose light reaches across both.
World wide_world() {
  World world;
  world.observations.board = Board::parse("charuco:11x8:25mm").value();
  world.shape = {world.observations.board.width_m(), world.observations.board.height_m()};
  world.bend.setZero();
  const Eigen::Vector3d up(0, -1, 0);
  const std::vector<double> distortion = {-0.08, 0.03, 0.0002, -0.0003};
  world.rig.cameras = {imager("camera0", 1280, 1024, {1400, 1400, 640, 505}, distortion, Pose()),
                       imager("camera1", 1280, 1024, {1420, 1420, 632, 515}, distortion,
                              looking_at({0.9, 0, 0}, {0.9, 0, 1.1}, up))};
  world.rig.projectors = {imager("projector0", 1280, 800, {1400, 1400, 640, 400}, {0.02, 0, 0, 0},
                                 looking_at({0.45, 0.2, -0.6}, {0.45, 0, 1.1}, up))};
  for (const Imager& i : world.rig.cameras) world.observations.cameras.push_back({i.name, i.width, i.height});
  world.observations.projectors = {{"projector0", 1280, 800}};
  std::mt19937_64 rng(7);
  for (int pose = 0; pose < 16; ++pose) {
    const Pose aside(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.9 * (pose % 2), 0, 0));
    world.world_from_board.push_back(aside * board_place(pose, world.shape, 1.1, &rng));
    world.observations.poses.push_back(fmt::format("pose{:02}", pose));
    observe_corners(&world, pose % 2, pose);
    observe_matches(&world, pose % 2, 0, pose);
  }
  return world;
}

TEST(JoinedCameras, TheErrorMapCoversTheirWholeLength) {
  World world = wide_world();
  add_noise(&world, 0.02, 0.03, test_rng());
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  const Uncertainty uncertainty{solution->covariance, 0.02};
  const auto maps = error_maps(world.observations, *solution, uncertainty);
  ASSERT_EQ(maps.size(), 1U);
  const ErrorMap& map = maps[0];
  EXPECT_EQ(map.low.x(), 0) << "boards of camera 0 lie in its image";
  EXPECT_GT(map.high.x(), 1.7);
  EXPECT_LT(map.high.x(), 2.1);
  EXPECT_GT(map.columns, 26) << "cells as large as those of the image";
  EXPECT_EQ(map.planes[0].p95_mm.size(), static_cast<size_t>(map.columns * map.rows));
  const auto mm_at = [&](double x_m) {
    const auto place = map.place_of(solution->rig.cameras[0], {x_m, 0, 1.1});
    return place ? map.at(*place, 1.1) : std::nan("");
  };
  for (const double x_m : {0.0, 0.9}) {
    EXPECT_GT(mm_at(x_m), 0.01);
    EXPECT_LT(mm_at(x_m), 0.3) << "where boards stood";
  }
  EXPECT_TRUE(std::isnan(mm_at(2.5))) << "beyond the map";
  const double stated = propagated_error_mm(world.observations, *solution, uncertainty)[0];
  EXPECT_GT(stated, mm_at(0.9));
  EXPECT_LT(stated, 2);
}

TEST(JoinedCameras, TheCameraThatSeesATargetMeasuresIt) {
  World world = wide_world();
  add_noise(&world, 0.02, 0.03, test_rng());
  const auto solution = solve(world.observations);
  ASSERT_TRUE(solution.ok()) << solution.message();
  RigidTarget target;
  for (int i = 0; i < 9; ++i) target.emplace_back(0.9 + 0.1 * (i % 3 - 1), 0.1 * (i / 3 - 1), 1.1);
  const SurfaceTarget place{{0.9, 0, 1.1}, {0, 0, -1}};
  Uncertainty uncertainty{solution->covariance, 0};
  const auto both = light_covariances(*solution, uncertainty, target, 0, {&place, 1})[0];
  ASSERT_TRUE(both.has_value());
  uncertainty.covariance.topRows(14).setZero();  // camera 0's lens and pose, which play no part here
  uncertainty.covariance.leftCols(14).setZero();
  const auto own = light_covariances(*solution, uncertainty, target, 0, {&place, 1})[0];
  ASSERT_TRUE(own.has_value());
  EXPECT_LT((*both - *own).norm(), 1e-9 * both->norm());
}

}  // namespace
}  // namespace limn::calib
