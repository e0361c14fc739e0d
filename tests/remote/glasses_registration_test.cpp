#include "remote/glasses/glasses_registration.h"

#include <gtest/gtest.h>

#include "tests/remote/a_headset.h"
#include "tests/support/matchers.h"

namespace limn::remote {
namespace {

using Eigen::Vector3d;
using test::Headset;
using test::k_degree;

TEST(GlassesRegistration, FindsTheRoomWithinTenSecondsOfLookingRound) {
  auto rng = test::test_rng();
  double worst_m = 0, worst_rad = 0, longest_s = 0;
  for (int round = 0; round < 20; ++round) {
    Headset headset(rng());
    GlassesRegistration registration("apriltag_36h11:7");
    double needed_s = 100;
    while (headset.at_s() < 110) {
      headset.play(headset.at_s() + 0.1, &registration);
      if (registration.place()) needed_s = std::min(needed_s, headset.at_s() - 100);
    }
    ASSERT_TRUE(registration.place()) << registration.advice();
    EXPECT_EQ(registration.state(), GlassesState::registered);
    const Vector6d off = headset.error_of(*registration.place());
    worst_m = std::max(worst_m, off.tail<3>().norm());
    worst_rad = std::max(worst_rad, off.head<3>().norm());
    longest_s = std::max(longest_s, needed_s);
    EXPECT_NEAR(registration.place()->delay_s, headset.offset_s(), 2e-3);
    EXPECT_LT(boxminus(registration.place()->marker_from_eye, headset.marker_from_eye()).tail<3>().norm(),
              2e-3);
  }
  RecordProperty("worst_mm", fmt::format("{:.2f}", 1e3 * worst_m));
  EXPECT_LT(worst_m, 1e-3);
  EXPECT_LT(worst_rad, 0.1 * k_degree);
  EXPECT_LT(longest_s, 8);
}

// With these heads the first few pairs determine next to nothing.
TEST(GlassesRegistration, FindsTheRoomHoweverTheHeadBeginsToMove) {
  for (const std::uint64_t seed :
       {8754710472449431523U, 1560164250864816987U, 9786670671884617486U, 6123566584078713170U,
        11523364915750226356U, 3284063751202875142U, 13538270341804406637U, 9849271338884063160U}) {
    Headset headset(seed);
    GlassesRegistration registration("apriltag_36h11:7");
    headset.play(110, &registration);
    ASSERT_TRUE(registration.place()) << registration.advice();
    EXPECT_LT(headset.error_of(*registration.place()).tail<3>().norm(), 1.5e-3);
  }
}

TEST(GlassesRegistration, StatesItsErrorWhileTheOdometryDrifts) {
  auto rng = test::test_rng();
  int within = 0, count = 0;
  double mean_square = 0, worst_m = 0;
  for (int round = 0; round < 40; ++round) {
    Headset headset(rng());
    GlassesRegistration registration("apriltag_36h11:7");
    headset.play(110, &registration);
    for (int i = 0; i < 20; ++i) {
      headset.play(headset.at_s() + 2, &registration);
      ASSERT_TRUE(registration.place()) << registration.advice();
      const Vector6d off = headset.error_of(*registration.place());
      const double squared = off.dot(headset.stated(*registration.place()).ldlt().solve(off));
      within += squared < 12.59;  // chi squared of 6 dimensions, 95 %
      mean_square += squared / 6;
      worst_m = std::max(worst_m, off.tail<3>().norm());
      ++count;
    }
  }
  EXPECT_GE(within, 0.90 * count) << mean_square / count;
  EXPECT_LE(within, 0.98 * count) << mean_square / count;
  EXPECT_LT(worst_m, 2.5e-3);
}

TEST(GlassesRegistration, SaysWhichMotionIsMissing) {
  auto rng = test::test_rng();
  Headset headset(rng());
  GlassesRegistration registration("apriltag_36h11:7");
  headset.is_marker_seen = false;
  headset.play(104, &registration);
  EXPECT_EQ(registration.state(), GlassesState::waiting);
  EXPECT_NE(registration.advice().find("No camera of the room sees the marker apriltag_36h11:7"),
            std::string::npos);
  headset.is_marker_seen = true;
  headset.turn_rad = 0.02;
  headset.roll_rad = 0;
  headset.play(110, &registration);
  EXPECT_EQ(registration.state(), GlassesState::looking_round);
  EXPECT_NE(registration.advice().find("left and right"), std::string::npos) << registration.advice();
  headset.turn_rad = 0.6;
  headset.play(124, &registration);
  EXPECT_EQ(registration.state(), GlassesState::registered) << registration.advice();
}

TEST(GlassesRegistration, SaysThatTheHeadMustNod) {
  auto rng = test::test_rng();
  Headset headset(rng());
  GlassesRegistration registration("apriltag_36h11:7");
  headset.nod_rad = 0.01;
  headset.roll_rad = 0;
  headset.play(108, &registration);
  EXPECT_EQ(registration.state(), GlassesState::looking_round);
  EXPECT_NE(registration.advice().find("Nod"), std::string::npos) << registration.advice();
  headset.nod_rad = 0.4;
  headset.play(125, &registration);
  EXPECT_EQ(registration.state(), GlassesState::registered) << registration.advice();
}

TEST(GlassesRegistration, AJumpOfTheOdometryIsNotDrawnWith) {
  auto rng = test::test_rng();
  for (int round = 0; round < 5; ++round) {
    Headset headset(rng());
    GlassesRegistration registration("apriltag_36h11:7");
    headset.play(112, &registration);
    ASSERT_TRUE(registration.place());
    headset.jump();
    headset.play(113.5, &registration);
    headset.play(118, &registration);
    ASSERT_TRUE(registration.place()) << registration.advice();
    EXPECT_LT(headset.error_of(*registration.place()).tail<3>().norm(), 2e-3);
  }
}

TEST(GlassesRegistration, AMarkerThatMovedOnTheGlassesIsNotDrawnWith) {
  auto rng = test::test_rng();
  for (const bool sleeps : {false, true}) {
    Headset headset(rng());
    GlassesRegistration registration("apriltag_36h11:7");
    headset.play(112, &registration);
    ASSERT_TRUE(registration.place());
    headset.move_marker();
    if (sleeps) registration.set_asleep();
    while (headset.at_s() < 125) {
      headset.play(headset.at_s() + 0.1, &registration);
      if (headset.at_s() > 112.5 && registration.place()) {
        EXPECT_LT(headset.error_of(*registration.place()).tail<3>().norm(), 5e-3) << headset.at_s();
      }
    }
    EXPECT_TRUE(registration.place()) << registration.advice();
  }
}

TEST(GlassesRegistration, LossAndSleepEndThePlaceAtOnce) {
  auto rng = test::test_rng();
  Headset headset(rng());
  GlassesRegistration registration("apriltag_36h11:7");
  headset.play(112, &registration);
  ASSERT_TRUE(registration.place());
  registration.set_lost();
  registration.update(headset.at_s());
  EXPECT_EQ(registration.state(), GlassesState::lost);
  EXPECT_FALSE(registration.place());
  registration.set_asleep();
  registration.update(headset.at_s());
  EXPECT_EQ(registration.state(), GlassesState::asleep);
  headset.jump();
  headset.play(112.2, &registration);
  EXPECT_FALSE(registration.place()) << "before the marker has said where the feed is now";
  headset.play(115, &registration);
  ASSERT_TRUE(registration.place()) << registration.advice();
  EXPECT_LT(headset.error_of(*registration.place()).tail<3>().norm(), 2e-3);
  headset.sends_poses = false;
  headset.play(117, &registration);
  EXPECT_EQ(registration.state(), GlassesState::lost);
  EXPECT_NE(registration.advice().find("No poses"), std::string::npos);
}

TEST(GlassesRegistration, WithoutTheMarkerItIsGivenUpInTheEnd) {
  auto rng = test::test_rng();
  Headset headset(rng());
  GlassesRegistration registration("apriltag_36h11:7");
  headset.play(112, &registration);
  headset.is_marker_seen = false;
  headset.play(122, &registration);
  ASSERT_TRUE(registration.place());
  const double after_ten_s = registration.place()->eye_stddev_m;
  EXPECT_GT(after_ten_s, 0.7e-3);
  headset.play(900, &registration);
  EXPECT_FALSE(registration.place());
  EXPECT_NE(registration.advice().find("No camera"), std::string::npos) << registration.advice();
}

TEST(GlassesRegistration, AHeadAtRestMaySendFewPoses) {
  auto rng = test::test_rng();
  Headset headset(rng());
  GlassesRegistration registration("apriltag_36h11:7");
  headset.play(112, &registration);
  const int used = registration.used();
  headset.stand_still();
  headset.pose_every = 60;  // two poses a second
  headset.play(132, &registration);
  ASSERT_TRUE(registration.place()) << registration.advice();
  EXPECT_GT(registration.used(), used + 20);
  EXPECT_LT(headset.error_of(*registration.place()).tail<3>().norm(), 2.5e-3);
}

TEST(GlassesRegistration, AMarkerOnAnotherHeadIsNoticed) {
  auto rng = test::test_rng();
  Headset headset(rng()), other(rng());
  GlassesRegistration registration("apriltag_36h11:7"), unused("apriltag_36h11:8");
  headset.is_marker_seen = other.sends_poses = false;
  bool was_said = false;
  while (headset.at_s() < 115) {
    headset.play(headset.at_s() + 0.05, &registration);
    other.play(other.at_s() + 0.05, &registration);
    was_said |= registration.advice().find("does not move as these glasses do") != std::string::npos;
    EXPECT_FALSE(registration.place());
  }
  EXPECT_TRUE(was_said) << registration.advice();
}

TEST(GlassesRegistration, WrongPosesAndClocksAreSaid) {
  GlassesRegistration registration("apriltag_36h11:7");
  const Vector3d p(0, 1.6, 0);
  EXPECT_TRUE(registration.add_eye({1, 0, 0, 0}, p, 5, 100));
  EXPECT_NE(registration.add_eye({NAN, 0, 0, 0}, p, 5.1, 100.1).message().find("finite"), std::string::npos);
  EXPECT_NE(registration.add_eye({1, 0, 0, 0}, {0, INFINITY, 0}, 5.1, 100.1).message().find("finite"),
            std::string::npos);
  EXPECT_NE(registration.add_eye({2, 0, 0, 0}, p, 5.1, 100.1).message().find("length 2"), std::string::npos);
  EXPECT_NE(registration.add_eye({0, 0, 0, 0}, p, 5.1, 100.1).message().find("length 0"), std::string::npos);
  EXPECT_NE(registration.add_eye({1, 0, 0, 0}, 1e5 * p, 5.1, 100.1).message().find("1000 m"),
            std::string::npos);
  EXPECT_NE(registration.add_eye({1, 0, 0, 0}, p, 65, 100.1).message().find("clock jumped"),
            std::string::npos);
  EXPECT_TRUE(registration.add_eye({1, 0, 0, 0}, p, 65.1, 100.2));
  EXPECT_NE(registration.add_eye({1, 0, 0, 0}, p, 5, 100.3).message().find("clock jumped"),
            std::string::npos);
}

}  // namespace
}  // namespace limn::remote
