#include "tracker/motion.h"

#include <Eigen/Dense>

#include "tests/support/matchers.h"

namespace limn::tracker {
namespace {

using Vector18d = Eigen::Matrix<double, 18, 1>;

Motion some_motion() {
  Motion motion;
  motion.world_from_body = Pose(exp_rotation({0.4, -0.9, 0.3}), {0.2, -0.1, 1.1});
  motion.velocity << 1.2, -0.7, 2, 0.3, -0.2, 0.1;
  motion.acceleration << -3, 5, 1, 0.8, 1.5, -2;
  return motion;
}

Motion moved(const Motion& motion, const Vector18d& delta) {
  Motion out = motion;
  out.world_from_body = boxplus(motion.world_from_body, delta.head<6>());
  out.velocity += delta.segment<6>(6);
  out.acceleration += delta.tail<6>();
  return out;
}

Vector18d between(const Motion& to, const Motion& from) {
  Vector18d delta;
  delta << boxminus(to.world_from_body, from.world_from_body), to.velocity - from.velocity,
      to.acceleration - from.acceleration;
  return delta;
}

TEST(Motion, CarriesItsCovarianceByTheDerivativeOfItsOwnStep) {
  auto rng = test::test_rng();
  std::normal_distribution<double> normal;
  Motion motion = some_motion();
  Matrix18d root;
  for (int i = 0; i < 18; ++i)
    for (int j = 0; j < 18; ++j) root(i, j) = normal(rng);
  motion.covariance = root * root.transpose();
  constexpr double k_seconds = 0.12, k_step = 1e-6;
  const Motion later = propagated(motion, k_seconds, {});
  Matrix18d f;
  for (int i = 0; i < 18; ++i) {
    const Vector18d step = k_step * Vector18d::Unit(i);
    f.col(i) = between(propagated(moved(motion, step), k_seconds, {}),
                       propagated(moved(motion, -step), k_seconds, {})) /
               (2 * k_step);
  }
  const Matrix18d expected = f * motion.covariance * f.transpose();
  EXPECT_LT((later.covariance - expected).norm(), 1e-6 * expected.norm());
}

TEST(Motion, GrowsAlikeInOneStepAndInMany) {
  Motion whole = some_motion();
  whole.velocity.setZero();  // rotation would mix the axes
  whole.acceleration.setZero();
  Motion steps = whole;
  const MotionNoise noise{.turn_jerk = 7, .jerk = 3, .turn_drift = 0.1, .drift = 0.2};
  for (int i = 0; i < 8; ++i) steps = propagated(steps, 0.025, noise);
  whole = propagated(whole, 0.2, noise);
  EXPECT_LT((steps.covariance - whole.covariance).norm(), 1e-9 * whole.covariance.norm());
  EXPECT_GT(whole.covariance(5, 5), 0.2 * 0.2);
}

TEST(Motion, LearnsVelocityFromTwoPoses) {
  Motion motion;
  motion.covariance.diagonal() << Vector6d::Constant(1e-6), Vector6d::Constant(100), Vector6d::Constant(1e-8);
  Vector6d velocity;
  velocity << 0.5, 0.2, -0.3, 0.1, -0.4, 0.25;
  motion = propagated(motion, 0.1, {});
  const PoseFit fit{boxplus(Pose{}, 0.1 * velocity), 1e-6 * Matrix6d::Identity(), 0, 0};
  const Motion after = corrected(motion, fit);
  EXPECT_TRUE(test::near(after.velocity, velocity, 1e-2));
  EXPECT_LT(after.covariance(6, 6), 1e-2);
  EXPECT_TRUE(test::pose_near(after.world_from_body, fit.world_from_body, 1e-9, 1e-9));
  EXPECT_LT((after.pose_covariance() - fit.covariance).norm(), 1e-9);
}

TEST(Motion, MixesToTheMeanAndCovarianceOfItsParts) {
  Motion a = some_motion(), b = a;
  a.covariance = 0.01 * Matrix18d::Identity();
  b.covariance = 0.03 * Matrix18d::Identity();
  b.world_from_body.translation += Eigen::Vector3d(0.4, 0, 0);
  const Motion mean = mixed(a, 0.25, b, 0.75);
  EXPECT_NEAR(mean.world_from_body.translation.x(), a.world_from_body.translation.x() + 0.3, 1e-12);
  EXPECT_NEAR(mean.covariance(3, 3), 0.025 + 0.25 * 0.75 * 0.16, 1e-12);
  EXPECT_NEAR(mean.covariance(4, 4), 0.025, 1e-12);
}

}  // namespace
}  // namespace limn::tracker
