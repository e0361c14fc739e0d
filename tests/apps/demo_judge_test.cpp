#include "apps/demo_judge.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/support/matchers.h"

namespace limn::apps {
namespace {

using namespace test::literals;

constexpr double k_distance_m = 1;
constexpr double k_focal_px = 1000;  // 1 mm on the plane a pixel

// A plane of 0.4 x 0.3 m at z = 1 m in front of a pinhole projector at the origin.
sim::World plane_world() {
  auto mesh = std::make_shared<scene::Mesh>();
  mesh->positions = {{-0.2f, -0.15f, 0}, {0.2f, -0.15f, 0}, {0.2f, 0.15f, 0}, {-0.2f, 0.15f, 0}};
  mesh->normals.assign(4, {0, 0, -1});
  mesh->triangles = {{0, 2, 1}, {0, 3, 2}};
  mesh->triangle_materials = {0, 0};
  sim::World world;
  world.rig.projectors = {
      {"projector0", 640, 480, Lens::pinhole(k_focal_px, k_focal_px, 319.5, 239.5), Pose()}};
  world.projector_effects.resize(1);
  world.world_from_prototype = Pose(Eigen::Quaterniond::Identity(), {0, 0, k_distance_m});
  sim::Object prototype;
  prototype.name = "prototype";
  prototype.mesh = mesh;
  prototype.world_from_object = world.world_from_prototype;
  world.objects = {prototype};
  return world;
}

// The discs drawn by hand into the projector's picture, 8-fold sub-pixels, moved by `shift_px`.
cv::Mat drawn(const AimedDots& dots, double shift_px) {
  cv::Mat picture(480, 640, CV_8UC3, cv::Scalar::all(0));
  for (const Eigen::Vector3d& p : dots.p_aimed) {
    const Eigen::Vector2d px(k_focal_px * p.x() + 319.5 + shift_px, k_focal_px * p.y() + 239.5);
    const int fraction_bits = 6;
    const auto fixed = [&](double v) { return cvRound(v * (1 << fraction_bits)); };
    cv::circle(picture, {fixed(px.x()), fixed(px.y())}, fixed(2.2), cv::Scalar::all(255), cv::FILLED,
               cv::LINE_AA, fraction_bits);
  }
  return picture;
}

TEST(DemoJudge, DotsLieOnThePrototypeAndApart) {
  const AimedDots dots = aimed_dots(plane_world(), 400, 1);
  ASSERT_EQ(dots.p_aimed.size(), 400u);
  for (std::size_t i = 0; i < dots.p_aimed.size(); ++i) {
    EXPECT_NEAR(dots.p_aimed[i].z(), 0, 1e-9);
    for (std::size_t j = 0; j < i; ++j) EXPECT_GT((dots.p_aimed[i] - dots.p_aimed[j]).norm(), 0.0065);
  }
}

TEST(DemoJudge, LightWhereItWasAimedScoresNearZero) {
  const sim::World world = plane_world();
  const AimedDots dots = aimed_dots(world, 400, 1);
  const std::vector<cv::Mat> pictures = {drawn(dots, 0)};
  const Registration found = judged_registration(world, dots, pictures);
  EXPECT_EQ(found.unlit, 0);
  EXPECT_LT(found.rms_mm, 0.08) << "what drawing circles in whole levels leaves";
}

TEST(DemoJudge, AShiftOfOnePixelIsMeasuredInMillimetres) {
  const sim::World world = plane_world();
  const AimedDots dots = aimed_dots(world, 400, 1);
  const std::vector<cv::Mat> pictures = {drawn(dots, 1)};
  const Registration found = judged_registration(world, dots, pictures);
  EXPECT_NEAR(found.rms_mm, 1, 0.1);
  EXPECT_GE(found.p95_mm, found.rms_mm);
}

TEST(DemoJudge, DarknessCountsAsError) {
  const sim::World world = plane_world();
  const AimedDots dots = aimed_dots(world, 50, 1);
  const std::vector<cv::Mat> pictures = {cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(0))};
  const Registration found = judged_registration(world, dots, pictures);
  EXPECT_EQ(found.unlit, found.points);
  EXPECT_GT(found.rms_mm, 3);
}

TEST(DemoJudge, OutlineDistanceOfAShiftedSquare) {
  cv::Mat truth(200, 200, CV_8U, cv::Scalar(0)), found = truth.clone();
  truth(cv::Rect(50, 50, 80, 80)) = 255;
  found(cv::Rect(52, 50, 80, 80)) = 128;
  EXPECT_EQ(outline_distance_px(truth, truth), 0);
  EXPECT_NEAR(outline_distance_px(found, truth), std::sqrt(2.0), 0.15) << "two of four sides are 2 px off";
  EXPECT_TRUE(std::isinf(outline_distance_px(cv::Mat::zeros(200, 200, CV_8U), truth)));
}

TEST(DemoJudge, LabelsMustAgreeForTheirIntersection) {
  cv::Mat truth(10, 10, CV_8U, cv::Scalar(0)), found = truth.clone();
  truth(cv::Rect(0, 0, 10, 4)) = 255;
  found(cv::Rect(0, 0, 10, 2)) = 255;
  found(cv::Rect(0, 2, 10, 2)) = 128;
  EXPECT_EQ(label_iou(truth, truth), 1);
  EXPECT_EQ(label_iou(found, truth), 0.5);
}

}  // namespace
}  // namespace limn::apps
