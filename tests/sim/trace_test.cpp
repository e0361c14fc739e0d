#include "sim/trace.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "sim/sensor_model.h"
#include "tests/sim/small_world.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"

namespace limn {
namespace {

using namespace test;

// Where the camera's pixel hits the wall, computed by hand.
Eigen::Vector3d wall_point(const sim::World& world, int column, int row, double wall_y = 1) {
  const Ray ray = *world.rig.cameras[0].ray(Eigen::Vector2d(column, row));
  return ray.p_origin + ray.d * (wall_y / ray.d.y());
}

std::size_t pixel_index(int column, int row) {
  return static_cast<std::size_t>(row) * 320 + static_cast<std::size_t>(column);
}

TEST(Trace, ProjectorAndCameraPixelsMeetAtKnownPoints) {
  const sim::World world = small_world();
  const sim::Samples samples = sim::trace(world, 0);
  int checked = 0;
  for (int row = 3; row < 240; row += 13)
    for (int column = 3; column < 320; column += 17) {
      const std::size_t i = pixel_index(column, row);
      const Eigen::Vector3d p = wall_point(world, column, row);
      EXPECT_TRUE(near(samples.p_world[i].cast<double>(), p, 1e-6));
      const auto px = world.rig.projectors[0].project(p);
      ASSERT_TRUE(px);
      if (!world.rig.projectors[0].contains(*px)) continue;
      EXPECT_TRUE(near(Eigen::Vector2d(samples.projectors[0][i].u, samples.projectors[0][i].v), *px, 1e-3));
      ++checked;
    }
  EXPECT_GT(checked, 150);
}

TEST(Trace, LightFallsWithSquaredDistanceAndCosine) {
  for (const double wall_y : {1.0, 1.7}) {
    const sim::World world = small_world(wall_y);
    const sim::Samples samples = sim::trace(world, 0);
    const Eigen::Vector3d p_light = world.rig.projectors[0].imager_from_world.inverse().translation;
    for (const auto& [column, row] : {std::pair{160, 120}, {120, 100}, {190, 140}}) {
      const Eigen::Vector3d towards = p_light - wall_point(world, column, row, wall_y);
      const double expected = -towards.y() / towards.norm() / towards.squaredNorm();
      EXPECT_NEAR(samples.projectors[0][pixel_index(column, row)].gain, expected, 1e-5 * expected);
    }
  }
}

TEST(Trace, AnOccluderCastsItsShadowWhereGeometrySays) {
  sim::World world = small_world();
  world.objects.push_back(sim::sheet("occluder", 0.1, 0.1, {}, facing_minus_y(0.2, 0.5, 0.1)));
  const sim::Samples samples = sim::trace(world, 0);
  const Eigen::Vector3d p_light = world.rig.projectors[0].imager_from_world.inverse().translation;
  int dark = 0, lit = 0;
  for (int row = 0; row < 240; ++row)
    for (int column = 0; column < 320; ++column) {
      const std::size_t i = pixel_index(column, row);
      const auto px = world.rig.projectors[0].project(samples.p_world[i].cast<double>());
      if (samples.object[i] != 0 || samples.weight[i] < 1 || !world.rig.projectors[0].contains(*px)) continue;
      const Eigen::Vector3d p = wall_point(world, column, row);
      const double t = (0.5 - p_light.y()) / (p.y() - p_light.y());
      const Eigen::Vector3d q = p_light + t * (p - p_light);  // in the occluder's plane
      const double margin = std::max(std::abs(q.x() - 0.2), std::abs(q.z() - 0.1)) - 0.05;
      const float gain = samples.projectors[0][i].gain;
      if (margin < -0.003) {
        ++dark;
        ASSERT_EQ(gain, 0) << column << " " << row;
      } else if (margin > 0.003) {
        ++lit;
        ASSERT_GT(gain, 0) << column << " " << row;
      }
    }
  EXPECT_GT(dark, 500);
  EXPECT_GT(lit, 5000);
}

TEST(Trace, AnOutOfSightProjectorGivesNoLight) {
  sim::World world = small_world();
  world.rig.projectors[0].imager_from_world = looking_at({0.3, 2, 0.1}, {0, 1, 0}, Eigen::Vector3d::UnitZ());
  const sim::Samples samples = sim::trace(world, 0);  // the projector lights the wall's back
  for (const sim::ProjectorView& view : samples.projectors[0]) ASSERT_EQ(view.gain, 0);
}

TEST(Trace, WeightsOfEveryPixelSumToOne) {
  sim::World world = small_world();
  cv::Mat checks(8, 8, CV_8U);
  for (int i = 0; i < 64; ++i) checks.at<std::uint8_t>(i / 8, i % 8) = (i + i / 8) % 2 != 0 ? 255 : 0;
  world.objects.push_back(sim::sheet("checks", 0.31, 0.31, checks, facing_minus_y(0.02, 0.9, 0.01)));
  const sim::Samples samples = sim::trace(world, 0);
  EXPECT_GT(samples.size(), 320U * 240U + 1000U);
  EXPECT_LT(samples.size(), 320U * 240U * 5 / 4);  // merged where sub-samples agree
  std::vector<float> sum(320 * 240, 0);
  for (std::size_t i = 0; i < samples.size(); ++i)
    sum[static_cast<std::size_t>(samples.pixel[i])] += samples.weight[i];
  for (const float s : sum) ASSERT_NEAR(s, 1, 1e-5);
}

// The edges of a black square in a white margin are found by moments of intensity along rows. Each must lie
// where its projected line crosses the row.
TEST(Trace, MarkerEdgesLieWhereTheTruthSays) {
  sim::World world = small_world();
  world.room.ambient = 1;
  world.camera_effects[0].psf_px = 0.7;
  cv::Mat square(100, 100, CV_8U, cv::Scalar(255));
  square(cv::Rect(20, 20, 60, 60)) = 0;
  const Pose world_from_sheet =
      facing_minus_y(0.013, 0.8, -0.007) * Pose(exp_rotation({0.3, -0.5, 0.08}), Eigen::Vector3d::Zero());
  world.objects = {sim::sheet("marker", 0.3, 0.3, square, world_from_sheet)};
  const cv::Mat light = sim::exposed(world, 0, sim::ideal_light(world, sim::trace(world, 0), {}));
  const double h = 0.3 * 0.3;  // half the black square's side
  const Imager& camera = world.rig.cameras[0];
  double squares = 0, sum = 0;
  int count = 0;
  for (const double side : {-1.0, 1.0}) {
    const Eigen::Vector2d a = *camera.project(world_from_sheet * Eigen::Vector3d(side * h, -h, 0));
    const Eigen::Vector2d b = *camera.project(world_from_sheet * Eigen::Vector3d(side * h, h, 0));
    for (int row = static_cast<int>(a.y()) + 6; row < static_cast<int>(b.y()) - 6; ++row) {
      const double x_true = a.x() + (b.x() - a.x()) * (row - a.y()) / (b.y() - a.y());
      const int middle = static_cast<int>(std::lround(x_true)), reach = 7;
      const float left = light.at<float>(row, middle - reach), right = light.at<float>(row, middle + reach);
      double share = 0;  // share of the right-hand level within the window
      for (int c = middle - reach; c <= middle + reach; ++c)
        share += (light.at<float>(row, c) - left) / (right - left);
      const double x = middle + reach + 0.5 - share;
      squares += (x - x_true) * (x - x_true);
      sum += x - x_true;
      ++count;
    }
  }
  ASSERT_GT(count, 100);
  // With 32 sub-samples in a pixel, each edge is accurate to 1/64 px.
  EXPECT_LT(std::sqrt(squares / count), 0.02);
  EXPECT_LT(std::abs(sum / count), 0.004);
}

TEST(Trace, AnotherPatternIsALookup) {
  const sim::World world = small_world();
  const sim::Samples samples = sim::trace(world, 0);
  cv::Mat a(150, 200, CV_8U, cv::Scalar(255)), b(150, 200, CV_8U);
  for (int r = 0; r < 150; ++r)
    for (int c = 0; c < 200; ++c) b.at<std::uint8_t>(r, c) = c / 3 % 2 == 0 ? 255 : 0;
  (void)sim::photograph(world, samples, std::vector<cv::Mat>{a}, 1);
  const cv::Mat lookup = sim::photograph(world, samples, std::vector<cv::Mat>{b}, 2);
  const cv::Mat traced = sim::photograph(world, sim::trace(world, 0), std::vector<cv::Mat>{b}, 2);
  EXPECT_TRUE(image_near(lookup, traced, 0, 0, "lookup"));
  EXPECT_GT(cv::norm(lookup, sim::photograph(world, samples, std::vector<cv::Mat>{a}, 2)), 100);
}

// A wall with two sheets before it, under a soft lamp.
sim::World room_with_sheets() {
  sim::World world = small_world();
  world.room.ambient = 0.2;
  world.room.lamps = {{{-0.4, -0.3, 0.8}, 1.0, 0.06}};
  cv::Mat checks(8, 8, CV_8U);
  for (int i = 0; i < 64; ++i) checks.at<std::uint8_t>(i / 8, i % 8) = (i + i / 8) % 2 != 0 ? 255 : 0;
  world.objects.push_back(sim::sheet("moving", 0.06, 0.06, checks, facing_minus_y(0.05, 0.8, 0)));
  world.objects.push_back(sim::sheet("still", 0.1, 0.1, checks, facing_minus_y(-0.15, 0.7, 0.1)));
  return world;
}

TEST(Trace, AfterAMoveTheAffectedPixelsAreTracedAndTheRestStaysTrue) {
  sim::World world = room_with_sheets();
  sim::ViewTracer tracer(0);
  EXPECT_EQ(tracer.samples(world).size(), sim::trace(world, 0).size());
  EXPECT_EQ(tracer.traced_pixels(), 320U * 240U);
  (void)tracer.samples(world);
  EXPECT_EQ(tracer.traced_pixels(), 0U) << "nothing has moved";
  auto rng = test_rng();
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d at(uniform(rng, -0.3, 0.3), uniform(rng, 0.5, 0.9), uniform(rng, -0.2, 0.2));
    const Eigen::Vector3d turn(uniform(rng, -1, 1), uniform(rng, -1, 1), uniform(rng, -1, 1));
    world.find("moving")->world_from_object =
        facing_minus_y(at.x(), at.y(), at.z()) * Pose(exp_rotation(turn), Eigen::Vector3d::Zero());
    const sim::Samples whole = sim::trace(world, 0);
    const sim::Samples& followed = tracer.samples(world);
    EXPECT_GT(tracer.traced_pixels(), 500U);
    EXPECT_LT(tracer.traced_pixels(), 320U * 240U * 6 / 10);
    ASSERT_EQ(followed.pixel, whole.pixel) << "move " << i;
    EXPECT_EQ(followed.object, whole.object);
    const cv::Mat white(150, 200, CV_8U, cv::Scalar(255));
    const cv::Mat a = sim::ideal_light(world, followed, std::vector<cv::Mat>{white});
    const cv::Mat b = sim::ideal_light(world, whole, std::vector<cv::Mat>{white});
    EXPECT_LT(cv::norm(a, b, cv::NORM_INF), 1e-4) << "move " << i;
    EXPECT_GT(cv::norm(b, cv::NORM_INF), 0.5);
  }
}

TEST(Trace, AnObjectThatComesOrGoesIsTracedToo) {
  sim::World world = room_with_sheets();
  sim::ViewTracer tracer(0);
  (void)tracer.samples(world);
  world.objects.push_back(sim::sheet("hand", 0.2, 0.2, {}, facing_minus_y(0, 0.6, 0)));
  EXPECT_EQ(tracer.samples(world).object, sim::trace(world, 0).object);
  world.objects.erase(world.objects.begin() + 1);
  EXPECT_EQ(tracer.samples(world).object, sim::trace(world, 0).object);
}

TEST(Trace, FewerSamplesAtEdgesKeepTheLight) {
  const sim::World world = room_with_sheets();
  const sim::Samples fine = sim::trace(world, 0),
                     coarse = sim::trace(world, 0, {.edge_samples = 8, .lamp_points = 3});
  EXPECT_LT(coarse.size(), fine.size());
  const cv::Mat a = sim::ideal_light(world, fine, {}), b = sim::ideal_light(world, coarse, {});
  EXPECT_NEAR(cv::mean(a)[0], cv::mean(b)[0], 0.01 * cv::mean(a)[0]);
  EXPECT_LT(cv::norm(a, b, cv::NORM_L2) / cv::norm(a, cv::NORM_L2), 0.05);
}

}  // namespace
}  // namespace limn
