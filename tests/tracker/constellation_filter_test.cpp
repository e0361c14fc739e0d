#include "tracker/balls/constellation_filter.h"

#include <gtest/gtest.h>

#include "tests/support/matchers.h"
#include "tests/tracker/crossing_balls.h"
#include "tracker/predict.h"

namespace limn::tracker {
namespace {

using namespace test::literals;

TEST(ConstellationFilter, CrossingConstellationsKeepTheirIdentities) {
  auto rng = test::test_rng();
  const test::Crossings count = test::crossings(600, rng);
  EXPECT_EQ(count.swapped, 0);
  EXPECT_EQ(count.elsewhere, 0);
  EXPECT_GT(count.visible, 400);  // the hands are near each other: balls hide each other half of the time
  // A triangle that is seen again after a moment is confirmed by two images, a new one by ten.
  EXPECT_GT(count.reported, count.visible * 13 / 20);
}

// Ten images confirm three balls in one camera; four balls need none.
TEST(ConstellationFilter, ThreeBallsAreReportedWhenTheyAreConfirmed) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  const Pose truth(exp_rotation({0.4, 0.3, 0}), {0, 0, 1.6});
  for (const Constellation& constellation : {test::triangle(), test::five_balls()}) {
    std::vector<BodyFilter> known;
    int first_reported = -1;
    for (int i = 0; i < 20; ++i) {
      const Stamp at = shifted(Stamp{} + std::chrono::seconds(1), i / 60.0);
      const std::vector<Ball> balls = test::balls_seen({{constellation, truth}}, camera, 0.03, rng);
      const BallView view{&camera, balls};
      known = observed(known, std::vector{constellation}, std::span(&view, 1), at);
      const std::vector<Track> tracks = predicted(known, at, Prediction::filtered);
      if (tracks.empty() || first_reported >= 0) continue;
      first_reported = i;
      EXPECT_TRUE(test::pose_near(tracks[0].world_from_body, truth, 1_deg, 1_mm));
    }
    EXPECT_EQ(first_reported, constellation.p_balls.size() == 3 ? 10 : 0);
  }
}

// The sizes of three balls that are seen with noise leave several poses open in one image; while the triangle
// turns only one of them stays possible.
TEST(ConstellationFilter, TheRightPoseOfThreeBallsIsChosenOverTime) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  const std::vector constellations = {test::triangle()};
  int ambiguous = 0, right = 0, late = 0;
  for (int trial = 0; trial < 10; ++trial) {
    const test::HandMotion hand(Pose(exp_rotation({0.4, 0.2, 0}), {0, 0, 2.5}), rng);
    std::vector<BodyFilter> known;
    for (int i = 0; i < 120; ++i) {
      const Stamp at = shifted(Stamp{} + std::chrono::seconds(1), i / 60.0);
      const Pose truth = hand.at(i / 60.0);
      const std::vector<Ball> balls = test::balls_seen({{constellations[0], truth}}, camera, 0.15, rng);
      const BallView view{&camera, balls};
      known = observed(known, constellations, std::span(&view, 1), at);
      ASSERT_EQ(known.size(), 1u);
      ambiguous += known[0].branches.size() > 1 ? 1 : 0;
      if (i < 60) continue;
      ++late;
      const Pose& pose = known[0].branches.front().moving.world_from_body;
      right += angle_between(pose.rotation, truth.rotation) < 6_deg ? 1 : 0;
    }
  }
  EXPECT_GT(ambiguous, 100);
  EXPECT_GE(right, late * 95 / 100);
}

// Three centres in one camera determine the pose exactly, so that the paper's triangle and the refined pose
// agree.
TEST(ConstellationFilter, ThePapersTriangleIsAvailableForThreeBalls) {
  auto rng = test::test_rng();
  const Imager camera = test::camera_1080p();
  const Pose truth(exp_rotation({0.4, 0.3, 0}), {0.1, 0.05, 1.6});
  const std::vector constellations = {test::triangle()};
  const auto fix_of = [&](const std::vector<Ball>& balls, TriplePose method) {
    const BallView view{&camera, balls};
    const auto known =
        observed({}, constellations, std::span(&view, 1), Stamp{} + std::chrono::seconds(1), {}, method);
    return known.at(0).fixes.back().world_from_body;
  };
  const auto exact = test::balls_seen({{constellations[0], truth}}, camera, 1e-6, rng);
  EXPECT_TRUE(test::pose_near(fix_of(exact, TriplePose::triangle), truth, 0.01_deg, 0.01_mm));
  for (int i = 0; i < 20; ++i) {
    const auto noisy = test::balls_seen({{constellations[0], truth}}, camera, 0.03, rng);
    const Pose by_triangle = fix_of(noisy, TriplePose::triangle);
    EXPECT_TRUE(test::pose_near(by_triangle, truth, 1_deg, 2_mm));
    EXPECT_TRUE(test::pose_near(by_triangle, fix_of(noisy, TriplePose::refined), 0.01_deg, 0.01_mm));
  }
}

}  // namespace
}  // namespace limn::tracker
