#include "calib/tie_points.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>

#include "tests/calib/observed_world.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

using namespace test;
using namespace limn::calib::worlds;
using Eigen::Vector2d;
using Eigen::Vector3d;

// A slanted wall in front of the rig, cut at x = 0: the right half is 0.1 m nearer.
std::optional<Vector3d> wall_at(const Imager& camera, const Vector2d& px) {
  const auto d_camera = camera.lens.unproject(px);
  if (!d_camera) return std::nullopt;
  const Pose world_from_camera = camera.imager_from_world.inverse();
  const Vector3d o = world_from_camera.translation, d = world_from_camera.rotation * *d_camera;
  for (const double z : {1.0, 1.1}) {
    const Vector3d n(0.2, 0.1, 1);
    const Vector3d p = o + (z - n.dot(o)) / n.dot(d) * d;
    if ((p.x() > 0) == (z == 1.0)) return p;
  }
  return std::nullopt;
}

std::vector<std::vector<Decoded>> decoded_wall(const World& world, double noise_px, std::mt19937_64 rng) {
  std::normal_distribution<double> scatter(0, noise_px);
  std::vector<std::vector<Decoded>> decoded;
  for (const Imager& camera : world.rig.cameras) {
    decoded.emplace_back(world.rig.projectors.size());
    for (size_t p = 0; p < world.rig.projectors.size(); ++p) {
      const float nan = std::numeric_limits<float>::quiet_NaN();
      cv::Mat& labels = decoded.back()[p].px_projector;
      labels = cv::Mat(camera.height, camera.width, CV_32FC2, cv::Scalar(nan, nan));
      for (int y = 0; y < camera.height; ++y) {
        for (int x = 0; x < camera.width; ++x) {
          const auto point = wall_at(camera, Vector2d(x, y));
          const auto px = point ? world.rig.projectors[p].project(*point) : std::nullopt;
          if (!px || !world.rig.projectors[p].contains(*px)) continue;
          labels.at<cv::Vec2f>(y, x) = {static_cast<float>(px->x() + scatter(rng)),
                                        static_cast<float>(px->y() + scatter(rng))};
        }
      }
    }
  }
  return decoded;
}

TEST(FreePointsOfAScene, AreSpreadAndAsSharpAsTheyClaim) {
  WorldOptions options;
  options.cameras = options.projectors = 2;
  options.poses = 0;
  World world = make_world(options);
  const auto decoded = decoded_wall(world, 0.2, test_rng());
  Observations& o = world.observations;
  add_tie_points(decoded, 3, {}, &o);
  ASSERT_GT(o.points.size(), 200U);
  EXPECT_LT(o.points.size(), 601U);
  std::set<std::pair<int, int>> quarters;
  double squared[2] = {}, count[2] = {};
  for (const TiePointObservation& tie_observation : o.tie_observations) {
    const TiePoint& point = o.points[static_cast<size_t>(tie_observation.point)];
    EXPECT_EQ(point.pose, 3);
    const auto which = static_cast<size_t>(tie_observation.imager);
    const Imager& seeing =
        tie_observation.by_projector ? world.rig.projectors[which] : world.rig.cameras[which];
    const auto p = wall_at(world.rig.cameras[static_cast<size_t>(point.camera)], point.px_camera);
    const auto px = seeing.project(*p);
    ASSERT_TRUE(px.has_value());
    const double pull = (*px - tie_observation.px).norm() / tie_observation.stddev_px;
    const size_t kind = tie_observation.by_projector ? 0 : 1;
    squared[kind] += std::min(pull * pull, 100.0) / 2;
    count[kind] += 1;
    if (point.camera == 0)
      quarters.emplace(static_cast<int>(point.px_camera.x() / 640),
                       static_cast<int>(point.px_camera.y() / 512));
  }
  EXPECT_EQ(quarters.size(), 4U);
  printf(
      "[ points   ] %zu points, %.0f projectors' and %.0f cameras' observations; normalised residuals %.2f "
      "and %.2f\n",
      o.points.size(), count[0], count[1], std::sqrt(squared[0] / count[0]),
      std::sqrt(squared[1] / count[1]));
  EXPECT_GT(count[1], 100);
  for (const size_t kind : {0, 1}) {
    EXPECT_GT(std::sqrt(squared[kind] / count[kind]), 0.6);
    EXPECT_LT(std::sqrt(squared[kind] / count[kind]), 1.5);
  }
}

TEST(RoomPoints, SurroundTheBoardAndLeaveItOut) {
  WorldOptions options;
  options.cameras = 2;
  options.poses = 0;
  World world = make_world(options);
  const auto decoded = decoded_wall(world, 0.1, test_rng());
  const std::vector<BoardCorner> board = {
      {0, {500, 400}, 0.1}, {1, {800, 420}, 0.1}, {2, {820, 600}, 0.1}, {3, {480, 580}, 0.1}};
  Observations& o = world.observations;
  o.points.push_back({});  // some may exist already
  add_room_points(decoded[1], board, 1, 7, {}, &o);
  ASSERT_GT(o.points.size(), 100U);
  int left = 0, right = 0;
  for (size_t i = 1; i < o.points.size(); ++i) {
    const TiePoint& point = o.points[i];
    EXPECT_EQ(point.pose, 7);
    EXPECT_EQ(point.camera, 1);
    const Vector2d px = point.px_camera;
    EXPECT_FALSE(px.x() > 500 && px.x() < 800 && px.y() > 420 && px.y() < 580) << px.transpose();
    left += px.x() < 480 ? 1 : 0;
    right += px.x() > 820 ? 1 : 0;
  }
  EXPECT_GT(left, 30);
  EXPECT_GT(right, 30);
  ASSERT_FALSE(o.tie_observations.empty());
  EXPECT_EQ(o.tie_observations.front().point, 1);
  for (const TiePointObservation& tie_observation : o.tie_observations) {
    const auto p =
        wall_at(world.rig.cameras[1], o.points[static_cast<size_t>(tie_observation.point)].px_camera);
    EXPECT_LT((*world.rig.projectors[0].project(*p) - tie_observation.px).norm(), 0.3);
  }
}

// A mark of 60 mm, 1.1 m in front of the cameras, moved aside.
std::optional<DetectedMark> mark_of(const World& world, int camera, int pose, double aside_m) {
  const Imager& eye = world.rig.cameras[static_cast<size_t>(camera)];
  DetectedMark mark{camera, pose, "apriltag_36h11:3", {}, 0.03};
  for (size_t i = 0; i < 4; ++i) {
    const double x = i == 1 || i == 2 ? 0.03 : -0.03, y = i > 1 ? 0.03 : -0.03;
    const auto px = eye.project(Vector3d(x + aside_m, y, 1.1 + 0.3 * x));
    if (!px) return std::nullopt;
    mark.corners_px[i] = *px;
  }
  return mark;
}

TEST(MarkerPoints, AMarkThatStandsStillTiesCamerasThatSeeItInDifferentPoses) {
  const World world = make_world(2, 1, 0, 0.5);
  Observations o = world.observations;
  o.points.push_back({});  // some may exist already
  const std::vector<DetectedMark> marks = {*mark_of(world, 0, 0, 0), *mark_of(world, 0, 2, 0),
                                           *mark_of(world, 1, 5, 0)};
  EXPECT_EQ(add_marker_points(marks, &o), std::vector<std::string>{"apriltag_36h11:3"});
  ASSERT_EQ(o.points.size(), 5U);
  ASSERT_EQ(o.tie_observations.size(), 4U);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(o.points[i + 1].pose, 0);
    EXPECT_EQ(o.points[i + 1].camera, 0);
    EXPECT_TRUE(near(o.points[i + 1].px_camera, marks[0].corners_px[i], 1e-9));
    EXPECT_EQ(o.tie_observations[i].point, static_cast<int>(i) + 1);
    EXPECT_FALSE(o.tie_observations[i].by_projector);
    EXPECT_EQ(o.tie_observations[i].imager, 1);
    EXPECT_TRUE(near(o.tie_observations[i].px, marks[2].corners_px[i], 1e-9));
    EXPECT_NEAR(o.tie_observations[i].stddev_px, 0.03 * std::sqrt(2.0), 1e-9);
  }
}

TEST(MarkerPoints, AMarkThatMovedTiesOnlyWithinAPose) {
  const World world = make_world(2, 1, 0, 0.5);
  Observations o = world.observations;
  const std::vector<DetectedMark> marks = {*mark_of(world, 0, 0, 0), *mark_of(world, 1, 0, 0),
                                           *mark_of(world, 0, 1, 0.05), *mark_of(world, 1, 2, 0.1)};
  EXPECT_EQ(add_marker_points(marks, &o).size(), 1U);
  ASSERT_EQ(o.points.size(), 4U);
  for (const TiePoint& point : o.points) EXPECT_EQ(point.pose, 0);
  for (const TiePointObservation& seen : o.tie_observations) EXPECT_EQ(seen.imager, 1);
}

TEST(MarkerPoints, OneCameraAloneIsNotTied) {
  const World world = make_world(2, 1, 0, 0.5);
  Observations o = world.observations;
  EXPECT_TRUE(add_marker_points({*mark_of(world, 0, 0, 0), *mark_of(world, 0, 1, 0)}, &o).empty());
  EXPECT_TRUE(o.points.empty());
}

}  // namespace
}  // namespace limn::calib
