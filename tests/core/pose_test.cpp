#include "core/pose.h"

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace limn {
namespace {

using namespace test::literals;

Pose random_pose(std::mt19937_64* rng) {
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Eigen::Vector3d(normal(*rng), normal(*rng), normal(*rng)); };
  return {exp_rotation(vector()), vector()};
}

TEST(Pose, CompositionTakesPointsThroughBothPoses) {
  auto rng = test::test_rng();
  const Pose a_from_b = random_pose(&rng), b_from_c = random_pose(&rng);
  const Eigen::Vector3d p_c(0.3, -2, 5);
  EXPECT_TRUE(test::near((a_from_b * b_from_c) * p_c, a_from_b * (b_from_c * p_c), 1e-14));
}

TEST(Pose, InverseUndoesAPose) {
  auto rng = test::test_rng();
  const Pose a_from_b = random_pose(&rng);
  EXPECT_TRUE(test::pose_near(a_from_b * a_from_b.inverse(), Pose(), 1e-14, 1e-14));
}

TEST(Pose, MatrixAgreesWithTheProduct) {
  auto rng = test::test_rng();
  const Pose a_from_b = random_pose(&rng);
  const Eigen::Vector3d p_b(1, 2, 3);
  EXPECT_TRUE(test::near((a_from_b.matrix() * p_b.homogeneous()).hnormalized(), a_from_b * p_b, 1e-13));
}

TEST(Pose, LogInvertsExpAlsoForTinyAndNearlyHalfTurns) {
  for (const double angle : {0.0, 1e-12, 1e-5, 0.1, 3.0, 3.14159}) {
    const Eigen::Vector3d w = angle * Eigen::Vector3d(2, -1, 2) / 3;
    EXPECT_TRUE(test::near(log_rotation(exp_rotation(w)), w, 1e-9)) << angle;
  }
}

TEST(Pose, ExpTurnsByTheRightHandRule) {
  const Eigen::Vector3d turned = exp_rotation({0, 0, 90_deg}) * Eigen::Vector3d::UnitX();
  EXPECT_TRUE(test::near(turned, Eigen::Vector3d::UnitY(), 1e-15));
}

TEST(Pose, BoxminusInvertsBoxplus) {
  auto rng = test::test_rng();
  const Pose pose = random_pose(&rng);
  Vector6d delta;
  delta << 0.3, -0.2, 1.1, 4, 5, -6;
  EXPECT_TRUE(test::near(boxminus(boxplus(pose, delta), pose), delta, 1e-13));
}

TEST(Pose, BoxplusPerturbsOnTheLeft) {
  const Pose pose(exp_rotation({0, 0, 90_deg}), {1, 0, 0});
  Vector6d delta;
  delta << 90_deg, 0, 0, 0, 0, 2;
  const Pose expected(exp_rotation({90_deg, 0, 0}) * pose.rotation, {1, 0, 2});
  EXPECT_TRUE(test::pose_near(boxplus(pose, delta), expected, 1e-14, 1e-14));
}

TEST(Pose, InterpolationHasItsEndsAndTheMiddleIsHalfWay) {
  auto rng = test::test_rng();
  const Pose from = random_pose(&rng), to = random_pose(&rng);
  EXPECT_TRUE(test::pose_near(interpolated(from, to, 0), from, 1e-14, 1e-14));
  EXPECT_TRUE(test::pose_near(interpolated(from, to, 1), to, 1e-13, 1e-13));
  const Pose middle = interpolated(from, to, 0.5);
  EXPECT_NEAR(angle_between(middle.rotation, from.rotation), angle_between(middle.rotation, to.rotation),
              1e-12);
  EXPECT_TRUE(test::near(middle.translation, (from.translation + to.translation) / 2, 1e-14));
}

TEST(Pose, LookingAtPutsTheTargetAheadAndUpUp) {
  const Eigen::Vector3d p_eye(1, 2, 3), p_target(0, 0, 1);
  const Pose camera_from_world = looking_at(p_eye, p_target, Eigen::Vector3d::UnitZ());
  EXPECT_TRUE(test::near(camera_from_world * p_eye, Eigen::Vector3d::Zero(), 1e-14));
  EXPECT_TRUE(test::near(camera_from_world * p_target, Eigen::Vector3d(0, 0, 3), 1e-14));
  EXPECT_LT((camera_from_world.rotation * Eigen::Vector3d::UnitZ()).y(), 0)
      << "the world's up direction is -y in the image";
  EXPECT_NEAR(camera_from_world.rotation_matrix().determinant(), 1, 1e-12);
}

}  // namespace
}  // namespace limn
