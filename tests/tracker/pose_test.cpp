#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/support/matchers.h"
#include "tests/support/random.h"
#include "tests/tracker/marker_images.h"
#include "tracker/body_estimate.h"
#include "tracker/body_pose.h"
#include "tracker/marker_pose.h"
#include "tracker/pose_fit.h"
#include "tracker/triangle_pose.h"

namespace limn::tracker {
namespace {

using namespace test::literals;
using test::uniform;
using Corners = std::array<Eigen::Vector2d, 4>;
using Covariances = std::array<Eigen::Matrix2d, 4>;

Lens bent_lens() {
  return Lens::create("LENSMODEL_OPENCV8", {600, 610, 322, 236, -0.2, 0.06, 1e-3, -5e-4, 0.01, 0, 0, 0})
      .value();
}

// A pose of a marker in front of the camera, tilted by `tilt`.
Pose random_pose(std::mt19937_64& rng, double tilt, double depth) {
  const double towards = uniform(rng, 0, 6.28);
  const Eigen::Quaterniond turn =
      exp_rotation(tilt * Eigen::Vector3d(std::cos(towards), std::sin(towards), 0)) *
      exp_rotation({0, 0, uniform(rng, 0, 6.28)});
  return Pose(turn, Eigen::Vector3d(uniform(rng, -0.2, 0.2), uniform(rng, -0.15, 0.15), depth));
}

Corners seen(const Lens& lens, const Pose& camera_from_marker, double size_m) {
  Corners px;
  const auto corners = square_corners(size_m);
  for (std::size_t i = 0; i < 4; ++i) px[i] = lens.project(camera_from_marker * corners[i]).value();
  return px;
}

Covariances even(double stddev) {
  Covariances c;
  c.fill(stddev * stddev * Eigen::Matrix2d::Identity());
  return c;
}

Corners noisy(Corners px, double stddev, std::mt19937_64& rng) {
  std::normal_distribution<double> noise(0, stddev);
  for (auto& p : px) p += Eigen::Vector2d(noise(rng), noise(rng));
  return px;
}

TEST(MarkerPose, ComesBackExactlyThroughABentLens) {
  auto rng = test::test_rng();
  const Lens lens = bent_lens();
  for (int i = 0; i < 200; ++i) {
    const Pose truth = random_pose(rng, uniform(rng, 0, 75_deg), uniform(rng, 0.4, 2));
    const auto poses = marker_poses(lens, 0.08, seen(lens, truth, 0.08), even(0.1));
    ASSERT_FALSE(poses.empty());
    EXPECT_TRUE(test::pose_near(poses[0].camera_from_marker, truth, 0.001_deg, 0.001_mm));
    EXPECT_LT(poses[0].rms_px, 1e-4);
  }
}

TEST(MarkerPose, KnowsBothBranchesOfASmallTiltedMarker) {
  auto rng = test::test_rng();
  const Lens lens = Lens::pinhole(600, 600, 320, 240);
  int both = 0;
  for (int i = 0; i < 50; ++i) {
    const Pose truth = random_pose(rng, 40_deg, 2.5);  // 19 px
    const auto poses = marker_poses(lens, 0.08, seen(lens, truth, 0.08), even(0.3));
    ASSERT_FALSE(poses.empty());
    double sum = 0;
    for (const auto& pose : poses) sum += pose.weight;
    EXPECT_NEAR(sum, 1, 1e-9);
    if (poses.size() < 2) continue;
    ++both;
    EXPECT_GT(angle_between(poses[0].camera_from_marker.rotation, poses[1].camera_from_marker.rotation),
              20_deg);
    EXPECT_GE(poses[0].weight, poses[1].weight);
  }
  EXPECT_GT(both, 40);
}

TEST(MarkerPose, HasTheCovarianceOfItsErrors) {
  auto rng = test::test_rng();
  const Lens lens = bent_lens();
  Vector6d squares = Vector6d::Zero();
  double mahalanobis = 0;
  constexpr int k_rounds = 400;
  for (int i = 0; i < k_rounds; ++i) {
    const Pose truth = random_pose(rng, 45_deg, 0.5);
    const auto poses = marker_poses(lens, 0.08, noisy(seen(lens, truth, 0.08), 0.1, rng), even(0.1));
    ASSERT_FALSE(poses.empty());
    const Vector6d error = boxminus(poses[0].camera_from_marker, truth);
    mahalanobis += error.dot(poses[0].covariance.inverse() * error) / 6 / k_rounds;
    squares += error.cwiseAbs2().cwiseQuotient(poses[0].covariance.diagonal()) / k_rounds;
  }
  EXPECT_NEAR(mahalanobis, 1, 0.15);
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(squares[k], 1, 0.3) << k;
}

TEST(MarkerPose, IsNoneWhereThereIsNone) {
  const Lens lens = Lens::pinhole(600, 600, 320, 240);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto at = [](double a, double b) { return Eigen::Vector2d(a, b); };
  const Covariances c = even(0.1);
  EXPECT_TRUE(marker_poses(lens, 0.08, {at(0, 0), at(0, 0), at(0, 0), at(0, 0)}, c).empty());
  EXPECT_TRUE(marker_poses(lens, 0.08, {at(0, 0), at(10, 0), at(20, 0), at(30, 0)}, c).empty());
  EXPECT_TRUE(marker_poses(lens, 0.08, {at(0, nan), at(10, 0), at(10, 10), at(0, 10)}, c).empty());
  EXPECT_TRUE(marker_poses(lens, 0.08, {at(0, 0), at(0, 10), at(10, 10), at(10, 0)}, c).empty());  // its back
  EXPECT_TRUE(marker_poses(lens, 0, {at(0, 0), at(10, 0), at(10, 10), at(0, 10)}, c).empty());
  EXPECT_TRUE(marker_poses(lens, 0.08, {at(0, 0), at(10, 0), at(10, 10), at(0, 10)}, even(0)).empty());
  EXPECT_FALSE(marker_poses(lens, 0.08, {at(0, 0), at(10, 0), at(10, 10), at(0, 10)}, c).empty());
}

TEST(PoseFit, HasTheDerivativeOfItsResidual) {
  auto rng = test::test_rng();
  const Lens lens = bent_lens();
  for (int i = 0; i < 30; ++i) {
    const Pose world_from_body = random_pose(rng, 30_deg, 0.8);
    const PointObservation observation{
        &lens,
        Pose(exp_rotation({0.1, -0.2, 0.05}), Eigen::Vector3d(0.02, 0.01, 0.1)),
        {0.03, -0.02, 0.01},
        {300, 200},
        Eigen::Matrix2d::Identity()};
    Eigen::Vector2d r, high, low;
    Eigen::Matrix<double, 2, 6> j;
    ASSERT_TRUE(residual(observation, world_from_body, &r, &j));
    for (int k = 0; k < 6; ++k) {
      const Vector6d step = 1e-6 * Vector6d::Unit(k);
      ASSERT_TRUE(residual(observation, boxplus(world_from_body, step), &high));
      ASSERT_TRUE(residual(observation, boxplus(world_from_body, -step), &low));
      EXPECT_TRUE(test::near(j.col(k), (high - low) / 2e-6, 1e-3 * std::max(1.0, j.col(k).norm())));
    }
  }
}

TEST(TrianglePose, GivesTheMotionForEveryChoiceOfFrame) {
  auto rng = test::test_rng();
  const Lens lens = bent_lens();
  for (const TriangleOrigin origin :
       {TriangleOrigin::vertex, TriangleOrigin::centroid, TriangleOrigin::side_midpoint})
    for (const int axis : {0, 1, 2})
      for (const bool flip : {false, true})
        for (const std::size_t omitted : {0u, 1u, 2u, 3u}) {
          const Pose truth = random_pose(rng, 40_deg, 0.7);
          const auto pose = triangle_pose(lens, 0.08, seen(lens, truth, 0.08), {origin, axis, flip}, omitted);
          ASSERT_TRUE(pose);
          EXPECT_TRUE(test::pose_near(*pose, truth, 0.001_deg, 0.001_mm));
        }
}

TEST(TrianglePose, PutsItsOriginWhereAsked) {
  const Triangle triangle = {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(2, 0, 0), Eigen::Vector3d(0, 3, 0)};
  EXPECT_TRUE(test::near(triangle_frame(triangle, {TriangleOrigin::vertex})->translation,
                         Eigen::Vector3d(0, 0, 0), 1e-12));
  EXPECT_TRUE(test::near(triangle_frame(triangle, {TriangleOrigin::side_midpoint})->translation,
                         Eigen::Vector3d(1, 0, 0), 1e-12));
  EXPECT_TRUE(test::near(triangle_frame(triangle, {TriangleOrigin::centroid})->translation,
                         Eigen::Vector3d(2. / 3, 1, 0), 1e-12));
  EXPECT_TRUE(test::near(triangle_frame(triangle)->rotation * Eigen::Vector3d::UnitZ(),
                         Eigen::Vector3d(0, 0, 1), 1e-12));
  EXPECT_FALSE(
      triangle_frame({Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(2, 2, 2)}));
}

TEST(TrianglePose, KnowsThatTheTwistIsTheGeneratorAndNotTheMotion) {
  const Pose motion(exp_rotation({0.3, -0.5, 0.8}), Eigen::Vector3d(0.1, -0.2, 0.4));
  const Eigen::Matrix4d theta = twist(motion);
  EXPECT_NEAR((theta.topLeftCorner<3, 3>() + theta.topLeftCorner<3, 3>().transpose()).norm(), 0, 1e-12);
  EXPECT_TRUE(test::pose_near(exp_twist(theta), motion, 1e-9, 1e-9));
  // exp as its power series, independent of Limn's code.
  Eigen::Matrix4d term = Eigen::Matrix4d::Identity();
  Eigen::Matrix4d sum = term;
  for (int k = 1; k < 40; ++k) sum += term = Eigen::Matrix4d(term * theta / k);
  EXPECT_NEAR((sum - motion.matrix()).norm(), 0, 1e-12);
  EXPECT_GT((theta - motion.matrix()).norm(), 0.5);  // the paper's printed matrix differs
  const Pose small(exp_rotation({1e-5, 2e-5, 0}), Eigen::Vector3d(1e-5, 0, 0));
  EXPECT_NEAR((Eigen::Matrix4d::Identity() + twist(small) - small.matrix()).norm(), 0, 1e-9);
}

struct World {
  Imager camera;
  Body body;
  Pose world_from_body;
};

World world() {
  World w;
  w.camera = {"camera0", 1280, 960, Lens::pinhole(1200, 1200, 639.5, 479.5),
              looking_at({0.2, -0.1, -1.5}, {0, 0, 0}, {0, -1, 0})};
  w.body.name = "prototype";
  for (int i = 0; i < 4; ++i)
    w.body.markers.push_back({{"aruco_4x4_50", std::to_string(i)},
                              0.05,
                              Pose(exp_rotation({0.2 * i, -0.1 * i, 0.3}),
                                   Eigen::Vector3d(0.1 * (i % 2), 0.1 * (i / 2), 0.02 * i))});
  w.world_from_body = Pose(exp_rotation({0.3, 0.2, -0.1}), Eigen::Vector3d(0.03, -0.02, 0.05));
  return w;
}

Detection detection_of(const World& w, std::size_t marker, double noise, std::mt19937_64& rng) {
  const BodyMarker& m = w.body.markers[marker];
  const Pose camera_from_marker = w.camera.imager_from_world * w.world_from_body * m.body_from_marker;
  Detection detection;
  detection.marker = m.marker;
  detection.corners_px = noisy(seen(w.camera.lens, camera_from_marker, m.size_m), noise, rng);
  detection.corner_covariance = even(std::max(noise, 0.01));
  detection.score = 1;
  return detection;
}

std::vector<Track> observed_by(const World& w, std::span<const Detection> detections) {
  const View view{&w.camera, detections};
  return observed(std::span(&w.body, 1), std::span(&view, 1), Stamp{});
}

TEST(BodyPose, JoinsItsMarkersAndIsBetterThanOne) {
  auto rng = test::test_rng();
  const World w = world();
  double one = 0, all = 0;
  for (int i = 0; i < 30; ++i) {
    std::vector<Detection> detections;
    for (std::size_t m = 0; m < 4; ++m) detections.push_back(detection_of(w, m, 0.1, rng));
    const auto tracks = observed_by(w, detections);
    const auto single = observed_by(w, std::span(detections).first(1));
    ASSERT_EQ(tracks.size(), 1u);
    ASSERT_EQ(single.size(), 1u);
    EXPECT_EQ(tracks[0].marker_count, 4);
    EXPECT_EQ(tracks[0].body, "prototype");
    all += angle_between(tracks[0].world_from_body.rotation, w.world_from_body.rotation);
    one += angle_between(single[0].world_from_body.rotation, w.world_from_body.rotation);
  }
  EXPECT_LT(all, 0.5 * one);
  EXPECT_LT(all / 30, 0.15_deg);
}

TEST(BodyPose, ChoosesTheConsistentOneOfTwoEqualMarkers) {
  auto rng = test::test_rng();
  const World w = world();
  std::vector<Detection> detections;
  Detection wrong = detection_of(w, 0, 0, rng);
  for (auto& px : wrong.corners_px) px += Eigen::Vector2d(150, 40);
  detections.push_back(wrong);  // first, so that taking the first fails
  for (std::size_t m = 0; m < 4; ++m) detections.push_back(detection_of(w, m, 0.05, rng));
  const auto tracks = observed_by(w, detections);
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_EQ(tracks[0].marker_count, 4);
  EXPECT_TRUE(test::pose_near(tracks[0].world_from_body, w.world_from_body, 0.3_deg, 1_mm));
}

TEST(BodyPose, BearsACoveredCorner) {
  auto rng = test::test_rng();
  const World w = world();
  std::vector<Detection> detections;
  for (std::size_t m = 0; m < 4; ++m) detections.push_back(detection_of(w, m, 0.05, rng));
  detections[1].corners_px[2] += Eigen::Vector2d(6, -4);
  const auto tracks = observed_by(w, detections);
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_TRUE(test::pose_near(tracks[0].world_from_body, w.world_from_body, 0.3_deg, 1_mm));
}

TEST(BodyPose, IsAbsentWithoutItsMarkers) {
  auto rng = test::test_rng();
  const World w = world();
  Detection other = detection_of(w, 0, 0, rng);
  other.marker.id = "17";
  EXPECT_TRUE(observed_by(w, std::span(&other, 1)).empty());
  EXPECT_TRUE(observed_by(w, {}).empty());
}

TEST(BodyPose, SeesWithTwoCameras) {
  auto rng = test::test_rng();
  World w = world();
  const std::vector<Detection> left = {detection_of(w, 0, 0.1, rng)};
  const Imager first = w.camera;
  w.camera.imager_from_world = looking_at({-0.9, 0.1, -1.2}, {0, 0, 0}, {0, -1, 0});
  const std::vector<Detection> right = {detection_of(w, 0, 0.1, rng)};
  const std::array<View, 2> views = {View{&first, left}, View{&w.camera, right}};
  const auto track = world_from_body(w.body, views, Stamp{});
  ASSERT_TRUE(track);
  EXPECT_EQ(track->marker_count, 2);
  EXPECT_TRUE(test::pose_near(track->world_from_body, w.world_from_body, 1_deg, 2_mm));
}

TEST(BodyPose, OfTwoCamerasHasTheCovarianceOfItsErrors) {
  auto rng = test::test_rng();
  const World left = world();
  World right = left;
  right.camera.imager_from_world = looking_at({-0.9, 0.1, -1.2}, {0, 0, 0}, {0, -1, 0});
  double normalised = 0, joint = 0, alone = 0;
  constexpr int k_rounds = 300;
  for (int i = 0; i < k_rounds; ++i) {
    std::vector<Detection> seen_left, seen_right;
    for (std::size_t m = 0; m < 3; ++m) seen_left.push_back(detection_of(left, m, 0.1, rng));
    for (std::size_t m = 1; m < 4; ++m) seen_right.push_back(detection_of(right, m, 0.1, rng));
    const std::array<View, 2> views = {View{&left.camera, seen_left}, View{&right.camera, seen_right}};
    const auto tracks = observed(std::span(&left.body, 1), views, Stamp{});
    ASSERT_EQ(tracks.size(), 1u);
    EXPECT_EQ(tracks[0].marker_count, 6);
    const Vector6d error = boxminus(tracks[0].world_from_body, left.world_from_body);
    normalised += error.dot(tracks[0].covariance.inverse() * error) / 6 / k_rounds;
    joint += error.tail<3>().squaredNorm();
    alone += boxminus(observed_by(left, seen_left)[0].world_from_body, left.world_from_body)
                 .tail<3>()
                 .squaredNorm();
  }
  EXPECT_NEAR(normalised, 1, 0.15);
  EXPECT_LT(joint, 0.25 * alone);  // two lines of sight: depth is no longer uncertain
}

}  // namespace
}  // namespace limn::tracker
