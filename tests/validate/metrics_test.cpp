#include "validate/metrics.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/support/matchers.h"
#include "tests/support/meshes.h"

namespace limn::validate {
namespace {

using namespace test::literals;

constexpr double k_distance_m = 1;
constexpr double k_focal_px = 1000;  // 1 mm on the plane for each pixel

// A plane of 0.4 x 0.3 m at z = 1 m in front of a pinhole projector at the origin.
sim::World plane_world() {
  sim::World world;
  world.rig.projectors = {
      {"projector0", 640, 480, Lens::pinhole(k_focal_px, k_focal_px, 319.5, 239.5), Pose()}};
  world.projector_effects.resize(1);
  world.world_from_prototype = Pose(Eigen::Quaterniond::Identity(), {0, 0, k_distance_m});
  sim::Object prototype;
  prototype.name = "prototype";
  prototype.mesh = std::make_shared<scene::Mesh>(test::sheet(0.4, 0.3, 0, 1));
  prototype.world_from_object = world.world_from_prototype;
  world.objects = {prototype};
  return world;
}

// The discs drawn directly into the projector's image (light = value), moved by `shift_px`: 8x8 sub-pixels.
cv::Mat drawn(const TargetDots& dots, double shift_px) {
  constexpr int k_sub = 8;
  const double radius_px = (dots.mesh.positions[1] - dots.mesh.positions[0]).norm() * k_focal_px;
  cv::Mat light(480, 640, CV_8U, cv::Scalar(0));
  for (const Eigen::Vector3d& p : dots.p_targets) {
    const Eigen::Vector2d centre(k_focal_px * p.x() + 319.5 + shift_px, k_focal_px * p.y() + 239.5);
    for (int y = static_cast<int>(centre.y()) - 4; y <= centre.y() + 4; ++y) {
      for (int x = static_cast<int>(centre.x()) - 4; x <= centre.x() + 4; ++x) {
        int inside = 0;
        for (int i = 0; i < k_sub * k_sub; ++i) {
          const Eigen::Vector2d sub((i % k_sub + 0.5) / k_sub - 0.5, (i / k_sub + 0.5) / k_sub - 0.5);
          inside += (Eigen::Vector2d(x, y) + sub - centre).norm() < radius_px;
        }
        if (inside) light.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(255 * inside / (k_sub * k_sub));
      }
    }
  }
  cv::Mat image;
  cv::merge(std::vector<cv::Mat>{light, light, light}, image);
  return image;
}

TEST(Judge, DotsLieOnThePrototypeAndApart) {
  const TargetDots dots = target_dots(plane_world(), 400, 1);
  ASSERT_EQ(dots.p_targets.size(), 400u);
  for (std::size_t i = 0; i < dots.p_targets.size(); ++i) {
    EXPECT_NEAR(dots.p_targets[i].z(), 0, 1e-9);
    for (std::size_t j = 0; j < i; ++j) EXPECT_GT((dots.p_targets[i] - dots.p_targets[j]).norm(), 0.0075);
  }
}

TEST(Judge, LightWhereItWasAimedScoresNearZero) {
  const sim::World world = plane_world();
  const TargetDots dots = target_dots(world, 400, 1);
  const std::vector<cv::Mat> images = {drawn(dots, 0)};
  const Registration found = judged_registration(world, dots, images);
  EXPECT_EQ(found.unlit, 0);
  EXPECT_LT(found.rms_mm, 0.03) << "what 8-bit levels and 8x8 sub-pixels leave";
}

TEST(Judge, AShiftOfOnePixelIsMeasuredInMillimetres) {
  const sim::World world = plane_world();
  const TargetDots dots = target_dots(world, 400, 1);
  const std::vector<cv::Mat> images = {drawn(dots, 1)};
  const Registration found = judged_registration(world, dots, images);
  EXPECT_NEAR(found.rms_mm, 1, 0.02);
  EXPECT_GE(found.p95_mm, found.rms_mm);
}

TEST(Judge, DarknessCountsAsError) {
  const sim::World world = plane_world();
  const TargetDots dots = target_dots(world, 50, 1);
  const std::vector<cv::Mat> images = {cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(0))};
  const Registration found = judged_registration(world, dots, images);
  EXPECT_EQ(found.unlit, found.points);
  EXPECT_GT(found.rms_mm, 3);
}

// A viewpoint in front of the plane and to its side, looking at its middle.
Imager viewer_beside() {
  const Pose eye_from_world = looking_at({0.5, -0.2, -0.1}, {0, 0, k_distance_m}, -Eigen::Vector3d::UnitY());
  return viewer_imager(eye_from_world.inverse(), 640, 480, 40);
}

TEST(Judge, FloatingDotsAreSeenBeforeTheirAimedPoints) {
  const sim::World world = plane_world();
  const Imager viewer = viewer_beside();
  const TargetDots dots = floating_dots(world, viewer, 0.05, 100, 1);
  ASSERT_GT(dots.p_centres.size(), 50u);
  for (std::size_t i = 0; i < dots.p_centres.size(); ++i) {
    EXPECT_NEAR(dots.p_centres[i].z(), -0.05, 1e-6) << "the plane's normal is -z";
    const auto seen = viewer.project(world.world_from_prototype * dots.p_centres[i]);
    const auto target = viewer.project(world.world_from_prototype * dots.p_targets[i]);
    EXPECT_NEAR((*seen - *target).norm(), 0, 1e-3);
  }
}

TEST(Judge, LightBesideAFloatingDotIsMeasuredAsTheEyeSeesIt) {
  const sim::World world = plane_world();
  const TargetDots dots = floating_dots(world, viewer_beside(), 0.05, 100, 1);
  const std::vector<cv::Mat> right = {drawn(dots, 0)}, beside = {drawn(dots, 1)};
  EXPECT_LT(judged_registration(world, dots, right).rms_mm, 0.03);
  const Registration found = judged_registration(world, dots, beside);
  // 1 mm along x on the plane, foreshortened from a viewpoint 24 degrees off; the discs' planes are 5 %
  // nearer.
  EXPECT_GT(found.rms_mm, 0.8);
  EXPECT_LT(found.rms_mm, 0.95);
}

TEST(Judge, TheWorstDifferenceOfSeriesIsOneLevelOfOnePixel) {
  const std::vector<cv::Mat> a = {cv::Mat::zeros(4, 5, CV_8UC3), cv::Mat::zeros(6, 7, CV_8UC3)};
  std::vector<cv::Mat> b = {a[0].clone(), a[1].clone()};
  EXPECT_EQ(worst_difference(a, b), 0);
  b[1].at<cv::Vec3b>(2, 3)[1] = 1;
  EXPECT_EQ(worst_difference(a, b), 1);
  EXPECT_TRUE(std::isinf(worst_difference(a, std::span(b).first(1))));
  b[0] = cv::Mat::zeros(5, 4, CV_8UC3);
  EXPECT_TRUE(std::isinf(worst_difference(a, b)));
}

TEST(Judge, OutlineDistanceOfAShiftedSquare) {
  cv::Mat truth(200, 200, CV_8U, cv::Scalar(0)), found = truth.clone();
  truth(cv::Rect(50, 50, 80, 80)) = 255;
  found(cv::Rect(52, 50, 80, 80)) = 128;
  EXPECT_EQ(outline_distance_px(truth, truth), 0);
  EXPECT_NEAR(outline_distance_px(found, truth), std::sqrt(2.0), 0.15) << "two of four sides are 2 px off";
  EXPECT_TRUE(std::isinf(outline_distance_px(cv::Mat::zeros(200, 200, CV_8U), truth)));
}

TEST(Judge, LabelsMustAgreeForTheirIntersection) {
  cv::Mat truth(10, 10, CV_8U, cv::Scalar(0)), found = truth.clone();
  truth(cv::Rect(0, 0, 10, 4)) = 255;
  found(cv::Rect(0, 0, 10, 2)) = 255;
  found(cv::Rect(0, 2, 10, 2)) = 128;
  EXPECT_EQ(label_iou(truth, truth), 1);
  EXPECT_EQ(label_iou(found, truth), 0.5);
}

}  // namespace
}  // namespace limn::validate
