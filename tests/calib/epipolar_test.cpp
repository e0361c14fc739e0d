#include "calib/judge/epipolar.h"

#include <gtest/gtest.h>

#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace worlds;
using Eigen::Vector2d;
using Eigen::Vector3d;

std::vector<DensePixel> dense_of(const World& world) {
  std::vector<DensePixel> dense;
  for (const Match& match : world.observations.matches)
    dense.push_back({match.camera, match.projector, match.pose, match.px_camera.cast<float>(),
                     match.px_projector.cast<float>(), true});
  return dense;
}

// Direction in the projector's image of a camera pixel's ray with increasing depth.
Vector2d along_line(const World& world, const Match& match) {
  const Imager& camera = world.rig.cameras[static_cast<size_t>(match.camera)];
  const Ray ray = *camera.ray(match.px_camera);
  const Imager& projector = world.rig.projectors[static_cast<size_t>(match.projector)];
  const auto near = projector.project(ray.p_origin + 1.0 * ray.d),
             far = projector.project(ray.p_origin + 1.2 * ray.d);
  return (*far - *near).normalized();
}

TEST(Epipolar, IsNothingForTrueLensesHoweverTheyDistort) {
  const World world = make_world(2, 2, 4, 0.6);
  const auto pairs = epipolar_residuals(world.rig, dense_of(world));
  ASSERT_EQ(pairs.size(), 4U);
  for (const EpipolarResidual& pair : pairs) {
    EXPECT_GT(pair.board.pixels, 500);
    EXPECT_EQ(pair.board.outliers, 0);
    EXPECT_LT(pair.board.rms_px, 1e-3);  // float pixels
  }
}

TEST(Epipolar, CountsWhatLiesAcrossTheLineAndNothingAlongIt) {
  const World world = make_world(1, 1, 3, 0.3);
  const Imager &camera = world.rig.cameras[0], &projector = world.rig.projectors[0];
  int judged = 0;
  for (const Match& match : world.observations.matches) {
    const Vector2d along = along_line(world, match), across(-along.y(), along.x());
    for (const double px : {-2.0, 0.5}) {
      const auto moved =
          epipolar_distance(camera, projector, match.px_camera, match.px_projector + px * across + 5 * along);
      ASSERT_TRUE(moved);
      EXPECT_NEAR(*moved, px, 0.02);  // the line bends a little over those five pixels
    }
    ++judged;
  }
  EXPECT_GT(judged, 500);
}

TEST(Epipolar, TellsWrongPixelsFromNoise) {
  World world = make_world(1, 1, 6, 0.0);
  add_noise(&world, 0, 0.2, test_rng());
  for (size_t i = 0; i < world.observations.matches.size(); i += 50)
    world.observations.matches[i].px_projector += 40 * Vector2d(1, 1);
  const auto pairs = epipolar_residuals(world.rig, dense_of(world));
  ASSERT_EQ(pairs.size(), 1U);
  EXPECT_NEAR(pairs[0].board.rms_px, 0.2, 0.02) << "noise of 0.2 px a coordinate is 0.2 px across any line";
  EXPECT_NEAR(pairs[0].board.outliers, static_cast<double>(world.observations.matches.size()) / 50, 2);
}

TEST(Epipolar, JudgesTheBoardAndTheRoomApart) {
  World world = make_world(1, 1, 3, 0.0);
  add_noise(&world, 0, 0.2, test_rng());
  auto dense = dense_of(world);
  for (size_t i = 0; i < dense.size(); i += 3) {
    dense[i].on_board = false;
    dense[i].px_projector += Eigen::Vector2f(1, 1);
  }
  const auto pairs = epipolar_residuals(world.rig, dense);
  EXPECT_NEAR(pairs[0].board.rms_px, 0.2, 0.02);
  EXPECT_GT(pairs[0].room.rms_px, 0.5);
  EXPECT_NEAR(2 * pairs[0].room.pixels, pairs[0].board.pixels, 3);
}

TEST(Epipolar, SeesADeviceThatIsTurnedByATenthOfADegree) {
  World world = make_world(1, 1, 3, 0.0);
  const auto dense = dense_of(world);
  Pose& pose = world.rig.projectors[0].imager_from_world;
  pose = Pose(exp_rotation(Vector3d(0.1_deg, 0, 0)), Vector3d::Zero()) * pose;
  EXPECT_GT(epipolar_residuals(world.rig, dense)[0].board.rms_px, 1.0);
}

}  // namespace
}  // namespace limn::calib
