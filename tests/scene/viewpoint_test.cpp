#include "scene/viewpoint.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <iostream>
#include <random>

#include "tests/support/matchers.h"

namespace limn::scene {
namespace {

using Eigen::Vector3d;

const Vector3d k_middle(0.1, 0.2, 0.3);

// A viewpoint in polar coordinates around the middle: distance, rotation about z, angle from z.
Viewpoint eye_at(const std::string& viewer, double distance, double turn_deg, double off_deg) {
  const double turn = turn_deg * M_PI / 180, off = off_deg * M_PI / 180;
  return {viewer, k_middle + distance * Vector3d(std::sin(off) * std::cos(turn),
                                                 std::sin(off) * std::sin(turn), std::cos(off))};
}

Vector3d settled(const std::vector<Viewpoint>& viewpoints) {
  return *updated_viewpoint({}, viewpoints, k_middle, 0).p_world();
}

TEST(SharedViewpoint, OfOnePersonIsThatEye) {
  EXPECT_FALSE(SharedViewpoint().p_world());
  const Viewpoint eye = eye_at("a", 1.3, 40, 20);
  EXPECT_TRUE(test::near(settled({eye}), eye.p_world, 1e-12));
}

TEST(SharedViewpoint, OfPeopleOnOneSideMisplacesPartsLeastInTheMeanSquare) {
  const std::vector<Viewpoint> viewpoints = {eye_at("a", 0.8, 0, 15), eye_at("b", 1.3, 100, 15),
                                             eye_at("c", 2, 220, 15)};
  // The position of the light on the plane through the middle for a point 2 mm above it.
  const auto error = [&](const Vector3d& p_eye) {
    const auto light = [](const Vector3d& p_from) {
      const Vector3d p = k_middle + Vector3d(0.03, -0.02, 0.002), d = p - p_from;
      return Vector3d(p - 0.002 / d.z() * d);
    };
    double squares = 0;
    for (const Viewpoint& eye : viewpoints) squares += (light(p_eye) - light(eye.p_world)).squaredNorm();
    return squares;
  };
  const Vector3d p_best = settled(viewpoints);
  for (int axis = 0; axis < 3; ++axis)
    for (const double step : {-0.02, 0.02})
      EXPECT_LT(error(p_best), error(p_best + step * Vector3d::Unit(axis))) << axis << " " << step;
  EXPECT_GT((p_best - (viewpoints[0].p_world + viewpoints[1].p_world + viewpoints[2].p_world) / 3).norm(),
            0.1);  // different from the unweighted mean
}

TEST(SharedViewpoint, StaysWithItsLeaderWhenAnotherOnTheOtherSideIsAboutAsNear) {
  auto rng = test::test_rng();
  std::normal_distribution<double> noise(0, 0.05);
  SharedViewpoint eye;
  for (int frame = 0; frame < 2000; ++frame) {
    const std::vector<Viewpoint> viewpoints = {eye_at("a", 1 + noise(rng), 0, 60),
                                               eye_at("b", 1 + noise(rng), 180, 60)};
    if (frame == 0) eye = updated_viewpoint(eye, std::span(viewpoints).first(1), k_middle, 0);
    eye = updated_viewpoint(eye, viewpoints, k_middle, 1 / 60.0);
    ASSERT_EQ(eye.leader, "a");
    ASSERT_TRUE(test::near(*eye.p_world(), viewpoints[0].p_world, 1e-9));
  }
  // A viewer who comes much nearer takes over, slowly.
  const std::vector<Viewpoint> viewpoints = {eye_at("a", 1, 0, 60), eye_at("b", 0.6, 180, 60)};
  for (int frame = 0; frame < 24; ++frame) eye = updated_viewpoint(eye, viewpoints, k_middle, 1 / 60.0);
  EXPECT_EQ(eye.leader, "b");
  EXPECT_TRUE(test::near(*eye.p_world(), (viewpoints[0].p_world + viewpoints[1].p_world) / 2, 0.01));
  for (int frame = 0; frame < 25; ++frame) eye = updated_viewpoint(eye, viewpoints, k_middle, 1 / 60.0);
  EXPECT_TRUE(test::near(*eye.p_world(), viewpoints[1].p_world, 1e-9));
}

TEST(SharedViewpoint, WaitsWhereItWasWhileNobodyIsSeen) {
  const Viewpoint a = eye_at("a", 1, 0, 30), back = eye_at("a", 1, 90, 30);
  SharedViewpoint eye = updated_viewpoint({}, std::span(&a, 1), k_middle, 0);
  eye = updated_viewpoint(eye, {}, k_middle, 100);
  EXPECT_TRUE(test::near(*eye.p_world(), a.p_world, 1e-12));
  eye = updated_viewpoint(eye, std::span(&back, 1), k_middle, 0.2);
  EXPECT_TRUE(test::near(*eye.p_world(), Vector3d(0.75 * a.p_world + 0.25 * back.p_world), 1e-12));
  eye = updated_viewpoint(eye, std::span(&back, 1), k_middle, 0.61);
  EXPECT_TRUE(test::near(*eye.p_world(), back.p_world, 1e-12));
  EXPECT_EQ(eye.shares.size(), 1u);
}

// People walk around a table at 1.5 m/s or less; they come, go and are not seen at random times.
TEST(SharedViewpoint, NeverMovesFasterThanPeopleWalkAndTheImageFades) {
  auto rng = test::test_rng();
  std::normal_distribution<double> noise(0, 1);
  std::uniform_real_distribution<double> uniform(0, 1);
  constexpr double k_seconds = 1 / 60.0, k_step = 1.5 * k_seconds, k_farthest = 4;
  constexpr int k_people = 5;
  std::vector<Viewpoint> people;
  std::vector<bool> is_seen(k_people, true);
  for (int i = 0; i < k_people; ++i) people.push_back(eye_at(std::to_string(i), 1.2, 72.0 * i, 50));
  const SharedViewpointOptions options;
  SharedViewpoint eye;
  int changes = 0, takeovers = 0;
  double worst = 0;
  for (int frame = 0; frame < 60 * 300; ++frame) {
    std::vector<Viewpoint> seen;
    for (std::size_t i = 0; i < k_people; ++i) {
      const Vector3d walk(noise(rng), noise(rng), 0.1 * noise(rng));
      const Vector3d p = people[i].p_world + k_step * walk.normalized();
      if ((p - k_middle).norm() < k_farthest / 2 && p.z() > k_middle.z()) people[i].p_world = p;
      if (uniform(rng) < 0.02) {
        is_seen[i] = !is_seen[i];
        ++changes;
      }
      if (is_seen[i]) seen.push_back(people[i]);
    }
    const SharedViewpoint after = updated_viewpoint(eye, seen, k_middle, k_seconds, options);
    takeovers += after.leader != eye.leader;
    double sum = 0;
    for (const SharedViewpoint::Share& share : after.shares) {
      EXPECT_GE(share.share, 0);
      sum += share.share;
    }
    ASSERT_LE(after.shares.size(), k_people + 1u);
    ASSERT_NEAR(sum, after.shares.empty() ? 0 : 1, 1e-9);
    if (eye.p_world()) worst = std::max(worst, (*after.p_world() - *eye.p_world()).norm());
    eye = after;
  }
  EXPECT_GT(changes, 500);
  EXPECT_GT(takeovers, 50);
  EXPECT_LT(worst, k_step + k_seconds / options.fade_s * k_farthest);
  std::cout << "at most " << 1e3 * worst << " mm a frame, " << takeovers << " changes of the leader\n";
}

}  // namespace
}  // namespace limn::scene
