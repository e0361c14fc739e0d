#include "tracker/hand_eye.h"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/support/matchers.h"
#include "tests/support/random.h"

namespace limn::tracker {
namespace {

using namespace test::literals;
using test::uniform;

Pose some_pose(std::mt19937_64& rng, double turn, double shift) {
  const auto vector = [&](double most) {
    return Eigen::Vector3d(uniform(rng, -most, most), uniform(rng, -most, most), uniform(rng, -most, most));
  };
  return {exp_rotation(vector(turn)), vector(shift)};
}

Matrix6d covariance_of(double turn, double shift) {
  Vector6d deviations;
  deviations << Eigen::Vector3d::Constant(turn), Eigen::Vector3d::Constant(shift);
  return deviations.cwiseAbs2().asDiagonal();
}

Pose noisy(const Pose& pose, const Matrix6d& covariance, std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  const Vector6d unit = Vector6d::NullaryExpr([&](auto) { return normal(rng); });
  return boxplus(pose, covariance.diagonal().cwiseSqrt().cwiseProduct(unit));
}

struct Scene {
  Pose world_from_feed, body_from_sensor;
  std::vector<PosePair> pairs;
};

// A headset that a person turns and moves about; its marker is 60 mm away from its own sensor.
Scene looking_round(int count, std::mt19937_64& rng, double outliers = 0) {
  Scene scene{some_pose(rng, 3, 2), some_pose(rng, 2, 0.06), {}};
  const Matrix6d body = covariance_of(2e-3, 0.5e-3), sensor = covariance_of(0.5e-3, 0.3e-3);
  for (int i = 0; i < count; ++i) {
    const Pose world_from_body = some_pose(rng, 0.6, 0.4);
    const Pose feed_from_sensor = scene.world_from_feed.inverse() * world_from_body * scene.body_from_sensor;
    scene.pairs.push_back(
        {noisy(world_from_body, body, rng), noisy(feed_from_sensor, sensor, rng), body, sensor});
    if (uniform(rng, 0, 1) < outliers)
      scene.pairs.back().world_from_body = scene.pairs.back().world_from_body * some_pose(rng, 0.5, 0.2);
  }
  return scene;
}

Vector6d off(const Pose& found, const Pose& truth) { return boxminus(found, truth); }

TEST(HandEye, FindsBothPosesFromExactPairs) {
  auto rng = test::test_rng();
  for (int i = 0; i < 20; ++i) {
    Scene scene = looking_round(4, rng);
    for (PosePair& pair : scene.pairs)
      pair.feed_from_sensor = scene.world_from_feed.inverse() * pair.world_from_body * scene.body_from_sensor;
    const auto found = solve_hand_eye(scene.pairs);
    ASSERT_TRUE(found.ok()) << found.message();
    EXPECT_LT(off(found->world_from_feed, scene.world_from_feed).norm(), 1e-6);
    EXPECT_LT(off(found->body_from_sensor, scene.body_from_sensor).norm(), 1e-6);
    EXPECT_LT(found->normalised_rms, 1e-3);
  }
}

TEST(HandEye, StatesItsErrorsByTheCovariance) {
  auto rng = test::test_rng();
  double feed = 0, sensor = 0;
  int beyond = 0;
  constexpr int k_rounds = 100;
  for (int i = 0; i < k_rounds; ++i) {
    const Scene scene = looking_round(30, rng);
    const auto found = solve_hand_eye(scene.pairs);
    ASSERT_TRUE(found.ok()) << found.message();
    const Vector6d y = off(found->world_from_feed, scene.world_from_feed),
                   x = off(found->body_from_sensor, scene.body_from_sensor);
    const Matrix6d of_y = found->covariance.topLeftCorner<6, 6>(),
                   of_x = found->covariance.bottomRightCorner<6, 6>();
    feed += y.dot(of_y.ldlt().solve(y)) / 6 / k_rounds;
    sensor += x.dot(of_x.ldlt().solve(x)) / 6 / k_rounds;
    for (int k = 0; k < 6; ++k) beyond += std::abs(x[k]) > 1.96 * std::sqrt(of_x(k, k));
    EXPECT_LT(x.tail<3>().norm(), 2e-3);
    EXPECT_NEAR(found->normalised_rms, 1, 0.35);
  }
  EXPECT_NEAR(feed, 1, 0.25);
  EXPECT_NEAR(sensor, 1, 0.25);
  EXPECT_LT(beyond, 0.1 * 6 * k_rounds);
  EXPECT_GT(beyond, 0.02 * 6 * k_rounds);
}

TEST(HandEye, IsNotMisledByWrongPairs) {
  auto rng = test::test_rng();
  for (int i = 0; i < 20; ++i) {
    const Scene scene = looking_round(60, rng, 0.15);
    const auto found = solve_hand_eye(scene.pairs);
    ASSERT_TRUE(found.ok()) << found.message();
    EXPECT_LT(off(found->body_from_sensor, scene.body_from_sensor).tail<3>().norm(), 2e-3);
    EXPECT_GT(found->outliers, 1);
  }
}

TEST(HandEye, SaysWhatIsMissing) {
  auto rng = test::test_rng();
  const Scene scene = looking_round(3, rng);
  EXPECT_NE(solve_hand_eye(std::span(scene.pairs).first(2)).message().find("found 2"), std::string::npos);
  std::vector<PosePair> about_one_axis;
  for (int i = 0; i < 30; ++i) {
    const Pose world_from_body(exp_rotation({0, 0.03 * i, 0}), {0.01 * i, 0, 1});
    about_one_axis.push_back(
        {world_from_body, scene.world_from_feed.inverse() * world_from_body * scene.body_from_sensor});
  }
  EXPECT_NE(solve_hand_eye(about_one_axis).message().find("two axes"), std::string::npos);
  auto broken = scene.pairs;
  broken[1].feed_from_sensor.translation.x() = NAN;
  EXPECT_NE(solve_hand_eye(broken).message().find("not finite"), std::string::npos);
}

// A head that looks round, sampled by two systems at rates of their own.
std::vector<TimedRotation> head(double late_s, double hz, double noise, std::mt19937_64& rng) {
  std::normal_distribution<double> normal(0, noise);
  std::vector<TimedRotation> rotations;
  for (double s = 0; s < 6; s += 1 / hz) {
    const double t = s - late_s;
    const Eigen::Vector3d w(0.3 * std::sin(2.1 * t), 0.5 * std::sin(3.3 * t + 1) + 0.1 * std::sin(9 * t),
                            0.1 * std::cos(1.7 * t));
    rotations.push_back({s, exp_rotation(w) * exp_rotation({normal(rng), normal(rng), normal(rng)})});
  }
  return rotations;
}

TEST(Delay, IsFoundBetweenSystemsOfOtherRates) {
  auto rng = test::test_rng();
  int within = 0;
  constexpr int k_rounds = 40;
  for (int i = 0; i < k_rounds; ++i) {
    const double truth = uniform(rng, -0.15, 0.2);
    const auto early = turn_speeds(head(0, 60, 3e-4, rng)), late = turn_speeds(head(truth, 90, 3e-4, rng));
    const auto found = estimate_delay(early, late);
    ASSERT_TRUE(found.ok()) << found.message();
    EXPECT_NEAR(found->seconds, truth, 2e-3);
    within += std::abs(found->seconds - truth) < 1.96 * found->stddev_s;
  }
  EXPECT_GE(within, 0.85 * k_rounds);
}

TEST(Delay, IsNotGuessedWithoutMotion) {
  auto rng = test::test_rng();
  std::vector<TimedRotation> still;
  for (int i = 0; i < 200; ++i) still.push_back({i / 60.0, Eigen::Quaterniond::Identity()});
  EXPECT_FALSE(estimate_delay(turn_speeds(still), turn_speeds(still)).ok());
  const auto early = turn_speeds(head(0, 60, 0, rng));
  EXPECT_FALSE(estimate_delay(early, {}).ok());
  auto later = early;
  for (TurnSpeed& speed : later) speed.at_s += 100;
  EXPECT_NE(estimate_delay(early, later).message().find("0.00 s"), std::string::npos);
}

}  // namespace
}  // namespace limn::tracker
