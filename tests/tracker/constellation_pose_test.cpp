#include "tracker/balls/constellation_pose.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/matchers.h"
#include "tests/support/random.h"
#include "tests/tracker/seen_balls.h"
#include "tests/tracker/seen_body.h"
#include "tracker/balls/ball_finder.h"
#include "tracker/balls/three_point_pose.h"

namespace limn::tracker {
namespace {

using namespace test::literals;
using test::uniform;

Eigen::Vector3d random_vector(double size, std::mt19937_64& rng) {
  return {uniform(rng, -size, size), uniform(rng, -size, size), uniform(rng, -size, size)};
}

TEST(ThreePointPose, TheTruthIsAmongItsSolutionsAndAllSuitTheRays) {
  auto rng = test::test_rng();
  for (int i = 0; i < 300; ++i) {
    const std::array<Eigen::Vector3d, 3> p = {random_vector(0.1, rng), random_vector(0.1, rng),
                                              random_vector(0.1, rng)};
    if ((p[1] - p[0]).cross(p[2] - p[0]).norm() < 2e-3) continue;
    const Pose truth(exp_rotation(random_vector(2, rng)),
                     Eigen::Vector3d(0, 0, 1.6) + random_vector(0.4, rng));
    std::array<Eigen::Vector3d, 3> d;
    for (std::size_t k = 0; k < 3; ++k) d[k] = (truth * p[k]).normalized();
    double nearest = 1;
    const std::vector<Pose> poses = three_point_poses(p, d);
    EXPECT_LE(poses.size(), 4u);
    for (const Pose& pose : poses) nearest = std::min(nearest, (pose.translation - truth.translation).norm());
    EXPECT_LT(nearest, 1e-3) << i;  // merged solutions are off by the root of the rounding error
  }
}

TEST(ThreePointPose, PointsOnALineHaveNone) {
  const std::array<Eigen::Vector3d, 3> p = {Eigen::Vector3d(0, 0, 0), {0.1, 0, 0}, {0.2, 0, 0}};
  std::array<Eigen::Vector3d, 3> d;
  for (std::size_t k = 0; k < 3; ++k) d[k] = (p[k] + Eigen::Vector3d(0, 0, 1)).normalized();
  EXPECT_TRUE(three_point_poses(p, d).empty());
}

// Errors of poses in the camera's axes.
struct Errors {
  int count = 0;
  double across = 0, along = 0, turn = 0;
  void add(const Pose& found, const Pose& truth) {
    const Eigen::Vector3d off = found.translation - truth.translation;
    ++count;
    across += 0.5 * off.head<2>().squaredNorm();
    along += off.z() * off.z();
    turn += std::pow(angle_between(found.rotation, truth.rotation), 2);
  }
  double rms(double sum) const { return std::sqrt(sum / count); }
};

cv::Mat image_of(const std::vector<test::PlacedConstellation>& all,
                 const Imager& camera,
                 std::mt19937_64& rng) {
  return test::image_of(camera.lens, test::plain(camera.width, camera.height, 40),
                        test::placed_balls(all, camera), {.blur_px = 0.6, .noise_levels = 2}, rng);
}

Pose turned_pose(double distance, std::mt19937_64& rng) {
  return {exp_rotation(random_vector(0.5, rng)),
          Eigen::Vector3d(uniform(rng, -0.3, 0.3), uniform(rng, -0.2, 0.2), distance)};
}

// Of the explanations, the one nearest to the truth.
const Pose& nearest(const std::vector<ConstellationFit>& fits, const Pose& truth) {
  return std::ranges::min_element(fits, {},
                                  [&](const ConstellationFit& fit) {
                                    return angle_between(fit.fit.world_from_body.rotation, truth.rotation);
                                  })
      ->fit.world_from_body;
}

TEST(ConstellationPose, ThreeBallsAndOneCameraAt1600Mm) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  BallFinder finder;
  Errors errors;
  int first_is_true = 0;
  for (int i = 0; i < 40; ++i) {
    const Pose truth = turned_pose(1.6, rng);
    const std::vector<Ball> balls =
        finder.find(image_of({{test::triangle(), truth}}, camera, rng), camera.lens);
    ASSERT_EQ(balls.size(), 3u);
    const BallView view{&camera, balls};
    const auto fits = identified(std::vector{test::triangle()}, std::span(&view, 1));
    ASSERT_FALSE(fits[0].empty()) << i;
    EXPECT_LE(fits[0].size(), 4u);
    if (angle_between(fits[0][0].fit.world_from_body.rotation, truth.rotation) < 3_deg) ++first_is_true;
    errors.add(nearest(fits[0], truth), truth);
  }
  EXPECT_LE(errors.rms(errors.across), 0.1_mm);
  EXPECT_LE(errors.rms(errors.along), 1_mm);
  EXPECT_GE(first_is_true, 32);
}

// The second camera looks from the side, at 60 degrees.
Imager side_camera() {
  Imager camera = test::camera_1080p();
  camera.name = "camera1";
  camera.imager_from_world = looking_at({1.4, 0, 0.8}, {0, 0, 1.6}, {0, -1, 0});
  return camera;
}

TEST(ConstellationPose, FiveBallsAndTwoCameras) {
  auto rng = test::test_rng();
  const std::array<Imager, 2> cameras = {test::camera_1080p(), side_camera()};
  BallFinder finder;
  Errors errors;
  int count = 0;
  for (int i = 0; i < 30; ++i) {
    const Pose truth = turned_pose(1.6, rng);
    std::array<std::vector<Ball>, 2> balls;
    std::vector<BallView> views;
    for (std::size_t c = 0; c < 2; ++c) {
      balls[c] = finder.find(image_of({{test::five_balls(), truth}}, cameras[c], rng), cameras[c].lens);
      views.push_back({&cameras[c], balls[c]});
    }
    const auto fits = identified(std::vector{test::triangle(), test::five_balls()}, views);
    EXPECT_TRUE(fits[0].empty());
    if (balls[0].size() < 4 && balls[1].size() < 4) continue;  // one ball before another
    ASSERT_EQ(fits[1].size(), 1u) << i << " " << balls[0].size() << " " << balls[1].size();
    errors.add(fits[1][0].fit.world_from_body, truth);
    ++count;
  }
  EXPECT_GE(count, 20);
  EXPECT_LE(errors.rms(errors.across), 0.1_mm);
  EXPECT_LE(errors.rms(errors.along), 0.1_mm);
  EXPECT_LE(errors.rms(errors.turn), 0.05_deg);
}

TEST(ConstellationPose, TheCovarianceIsThatOfTheErrors) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  double normalised = 0;
  const int count = 300;
  for (int i = 0; i < count; ++i) {
    const Pose truth = turned_pose(1.6, rng);
    const std::vector<Ball> balls = test::balls_seen({{test::five_balls(), truth}}, camera, 0.1, rng);
    const BallView view{&camera, balls};
    const auto fits = identified(std::vector{test::five_balls()}, std::span(&view, 1));
    if (balls.size() < 4) continue;
    ASSERT_EQ(fits[0].size(), 1u);
    const Vector6d off = boxminus(truth, fits[0][0].fit.world_from_body);
    normalised += off.dot(fits[0][0].fit.covariance.inverse() * off) / 6 / count;
  }
  EXPECT_GT(normalised, 0.75);
  EXPECT_LT(normalised, 1.2);
}

TEST(ConstellationPose, BallsThatAreNoConstellationAreNone) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  int found = 0;
  for (int i = 0; i < 100; ++i) {
    Constellation loose{"loose", 0.02, {}};  // balls anywhere
    for (int k = 0; k < 8; ++k) loose.p_balls.push_back(random_vector(0.4, rng));
    const std::vector<Ball> balls =
        test::balls_seen({{loose, Pose(Eigen::Quaterniond::Identity(), {0, 0, 1.6})}}, camera, 0.02, rng);
    const BallView view{&camera, balls};
    const auto fits = identified(std::vector{test::five_balls()}, std::span(&view, 1));
    found += fits[0].empty() ? 0 : 1;
  }
  EXPECT_EQ(found, 0);
}

}  // namespace
}  // namespace limn::tracker
