#include "tracker/balls/constellation_learning.h"

#include <gtest/gtest.h>

#include "core/linear_algebra.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"
#include "tests/tracker/seen_balls.h"
#include "tests/tracker/seen_body.h"

namespace limn::tracker {
namespace {

using namespace test::literals;
using test::uniform;

// Balls in images of a body that is turned from image to image, 0.7 m away.
std::vector<std::vector<Ball>> balls_in_images(const Constellation& truth,
                                               const Imager& camera,
                                               int images,
                                               std::mt19937_64& rng) {
  std::vector<std::vector<Ball>> all;
  for (int i = 0; i < images; ++i) {
    const Eigen::Vector3d turn(uniform(rng, -0.7, 0.7), uniform(rng, -0.7, 0.7), uniform(rng, -2, 2));
    const Pose pose(exp_rotation(turn), {uniform(rng, -0.1, 0.1), uniform(rng, -0.1, 0.1), 0.7});
    all.push_back(test::balls_seen({{truth, pose}}, camera, 0.03, rng));
  }
  return all;
}

Result<LearnedConstellation> learned_from(const std::vector<std::vector<Ball>>& balls,
                                          const Imager& camera,
                                          double radius_m = 0.02) {
  std::vector<BallView> views;
  for (const std::vector<Ball>& found : balls) views.push_back({&camera, found});
  return learn_constellation(views, radius_m, "wand");
}

// Compares places after the best rigid alignment, for any order of the balls; checks the stated deviations.
void expect_like(const LearnedConstellation& learned, const Constellation& truth, double within_m) {
  const std::vector<Eigen::Vector3d>& p = learned.constellation.p_balls;
  ASSERT_EQ(p.size(), truth.p_balls.size());
  // The order is that of the true balls with the nearest sums of distances to all others.
  const auto sum = [](const std::vector<Eigen::Vector3d>& all, std::size_t i) {
    double total = 0;
    for (const Eigen::Vector3d& one : all) total += (one - all[i]).norm();
    return total;
  };
  std::vector<Eigen::Vector3d> ordered;
  for (std::size_t i = 0; i < p.size(); ++i)
    ordered.push_back(*std::ranges::min_element(truth.p_balls, {}, [&](const Eigen::Vector3d& one) {
      return std::abs(sum(truth.p_balls, static_cast<std::size_t>(&one - truth.p_balls.data())) - sum(p, i));
    }));
  const Pose learned_from_truth = aligned(p, ordered);
  for (std::size_t i = 0; i < p.size(); ++i) {
    EXPECT_TRUE(test::near(p[i], learned_from_truth * ordered[i], within_m)) << i;
    EXPECT_LT((p[i] - learned_from_truth * ordered[i]).norm(), 4 * learned.stddev_m[i].norm()) << i;
  }
}

TEST(ConstellationLearning, LearnsATriangle) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  const auto learned = learned_from(balls_in_images(test::triangle(), camera, 12, rng), camera);
  ASSERT_TRUE(learned) << learned.message();
  EXPECT_GE(learned->images, 11);
  expect_like(*learned, test::triangle(), 0.15_mm);
}

TEST(ConstellationLearning, LearnsFiveBallsThoughSomeAreHiddenInPlaces) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  std::vector<std::vector<Ball>> balls = balls_in_images(test::five_balls(), camera, 16, rng);
  for (std::size_t i = 0; i < 6; ++i)
    if (balls[i].size() == 5) balls[i].pop_back();
  const auto learned = learned_from(balls, camera);
  ASSERT_TRUE(learned) << learned.message();
  expect_like(*learned, test::five_balls(), 0.15_mm);
}

TEST(ConstellationLearning, RoundThingsThatStandStillAreLeftOut) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  std::vector<std::vector<Ball>> balls = balls_in_images(test::five_balls(), camera, 16, rng);
  Constellation lamp{"lamp", 0.02, {{0.35, -0.2, 1.1}}};
  for (std::size_t i = 0; i < balls.size(); ++i)
    if (i % 4 == 0) balls[i].push_back(test::balls_seen({{lamp, Pose{}}}, camera, 0.03, rng).front());
  const auto learned = learned_from(balls, camera);
  ASSERT_TRUE(learned) << learned.message();
  EXPECT_EQ(learned->dropped_balls, 1);
  expect_like(*learned, test::five_balls(), 0.15_mm);
}

TEST(ConstellationLearning, TheDiameterGivesTheScale) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  Constellation larger = test::five_balls();
  for (Eigen::Vector3d& p : larger.p_balls) p *= 1.1;
  const auto learned = learned_from(balls_in_images(test::five_balls(), camera, 12, rng), camera, 0.022);
  ASSERT_TRUE(learned) << learned.message();
  expect_like(*learned, larger, 0.2_mm);
}

TEST(ConstellationLearning, SymmetricAndCollinearOnesAreRefused) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  const Constellation isosceles{"", 0.02, {{-0.09, -0.05, 0}, {0.09, -0.05, 0}, {0.001, 0.08, 0}}};
  const auto learned = learned_from(balls_in_images(isosceles, camera, 10, rng), camera);
  ASSERT_FALSE(learned);
  EXPECT_NE(learned.message().find("lie as balls"), std::string::npos) << learned.message();
  const Constellation line{"", 0.02, {{-0.09, 0, 0}, {0.10, 0, 0}, {0.02, 0.004, 0}}};
  const auto collinear = learned_from(balls_in_images(line, camera, 10, rng), camera);
  ASSERT_FALSE(collinear);
  EXPECT_NE(collinear.message().find("on a line"), std::string::npos) << collinear.message();
}

TEST(ConstellationLearning, TooFewImagesOrBallsAreErrors) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  EXPECT_NE(learned_from({}, camera).message().find("found at most 0"), std::string::npos);
  const auto two = learned_from(balls_in_images(test::triangle(), camera, 2, rng), camera);
  ASSERT_FALSE(two);
  EXPECT_NE(two.message().find("3 or more photographs"), std::string::npos) << two.message();
}

}  // namespace
}  // namespace limn::tracker
