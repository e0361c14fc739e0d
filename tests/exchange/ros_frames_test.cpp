#include "exchange/poses/ros_frames.h"

#include <gtest/gtest.h>

#include "exchange/poses/pose_decoder.h"
#include "tests/support/matchers.h"

namespace limn::exchange {
namespace {

using namespace test::literals;

const Eigen::Quaterniond k_turn(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));

RosPose moving(const std::string& parent, const std::string& child, double time_s, double x) {
  const Pose pose(k_turn, {x, 2, 3});
  return ros_pose({child, pose}, parent, child, std::llround(1e9 * time_s));
}

RosPose fixed(const std::string& parent, const std::string& child, double x) {
  RosPose out = moving(parent, child, 100, x);
  out.is_static = true;
  return out;
}

Pose pose_at(double x) { return {k_turn, {x, 2, 3}}; }

std::string message_of(const RosFrames& frames, const std::string& frame, const std::string& sensor) {
  const auto found = frames.locate(frame, sensor);
  return found ? "located" : found.message();
}

testing::AssertionResult has(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "'" << part << "' is not in: " << text;
}

TEST(RosFrames, AChainThroughACommonParentIsFollowedAtOneTime) {
  RosFrames frames;
  ASSERT_TRUE(frames.add(fixed("map", "table", 0.5)));
  ASSERT_TRUE(frames.add(moving("map", "base", 10, 1)));
  ASSERT_TRUE(frames.add(moving("map", "base", 11, 3)));
  ASSERT_TRUE(frames.add(fixed("base", "arm", 0.25)));
  ASSERT_TRUE(frames.add(moving("arm", "hand", 10.25, 7)));
  ASSERT_TRUE(frames.add(moving("arm", "hand", 10.75, 8)));
  const auto found = frames.locate("table", "hand");
  ASSERT_TRUE(found) << found.message();
  EXPECT_NEAR(found->time_s.value(), 10.75, 1e-6);  // up to which both moving ones are known
  const Pose expected = pose_at(0.5).inverse() * pose_at(2.5) * pose_at(0.25) * pose_at(8);
  EXPECT_TRUE(test::pose_near(found->frame_from_sensor, expected, 1e-6_deg, 1e-6));
  const auto back = frames.locate("hand", "table");
  ASSERT_TRUE(back);
  EXPECT_TRUE(test::pose_near(back->frame_from_sensor, expected.inverse(), 1e-6_deg, 1e-6));
}

TEST(RosFrames, SamplesThatComeInAnotherOrderAreSorted) {
  RosFrames frames;
  for (const double time_s : {10.0, 10.2, 10.1})
    ASSERT_TRUE(frames.add(moving("map", "base", time_s, time_s)));
  ASSERT_TRUE(frames.add(moving("base", "hand", 10.05, 0)));
  const auto found = frames.locate("map", "hand");
  ASSERT_TRUE(found);
  EXPECT_TRUE(test::pose_near(found->frame_from_sensor, pose_at(10.05) * pose_at(0), 1e-6_deg, 1e-6));
}

TEST(RosFrames, StaticOnesHoldForAllTimes) {
  RosFrames frames;
  ASSERT_TRUE(frames.add(fixed("map", "base", 1)));
  ASSERT_TRUE(frames.add(fixed("base", "hand", 2)));
  const auto found = frames.locate("map", "hand");
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->time_s);
  ASSERT_TRUE(frames.add(fixed("map", "base", 3)));
  EXPECT_GT(frames.locate("map", "hand")->change, found->change);
  EXPECT_TRUE(test::pose_near(frames.locate("map", "hand")->frame_from_sensor, pose_at(3) * pose_at(2),
                              1e-6_deg, 1e-6));
}

TEST(RosFrames, GapsLoopsAndClocksThatDisagreeAreNamed) {
  RosFrames frames;
  ASSERT_TRUE(frames.add(moving("base", "arm", 10, 1)));
  ASSERT_TRUE(frames.add(moving("arm", "hand", 10, 1)));
  EXPECT_TRUE(
      has(message_of(frames, "map", "hand"), "none from 'base' to another frame, and none from 'map'"));
  ASSERT_TRUE(frames.add(moving("map", "base", 15, 1)));
  EXPECT_TRUE(has(
      message_of(frames, "map", "hand"),
      "transform of frame 'base' at 10.000 s, up to which the others of its chain are known, found that it "
      "is known since 15.000 s"));
  ASSERT_TRUE(frames.add(moving("hand", "base", 16, 1)));
  EXPECT_TRUE(
      has(message_of(frames, "map", "hand"), "found a loop in the transforms: hand, arm, base, hand"));
}

TEST(RosFrames, AClockThatIsSetBackBeginsAnew) {
  RosFrames frames;
  ASSERT_TRUE(frames.add(fixed("map", "base", 1)));
  for (const double time_s : {1000.0, 1001.0, 5.0, 6.0}) {
    ASSERT_TRUE(frames.add(moving("base", "arm", time_s, 1)));
    ASSERT_TRUE(frames.add(moving("arm", "hand", time_s, time_s)));
  }
  const auto found = frames.locate("map", "hand");
  ASSERT_TRUE(found) << found.message();
  EXPECT_NEAR(found->time_s.value(), 6, 1e-6);
  EXPECT_TRUE(
      test::pose_near(found->frame_from_sensor, pose_at(1) * pose_at(1) * pose_at(6), 1e-6_deg, 1e-6));
}

TEST(RosFrames, WhatIsKeptIsLimited) {
  RosFrames frames;
  for (int i = 0; i < 1024; ++i)
    ASSERT_TRUE(frames.add(fixed(fmt::format("f{}", i), fmt::format("f{}", i + 1), 1)));
  EXPECT_TRUE(has(frames.add(fixed("map", "base", 1)).message(), "at most 1024 frames"));
  EXPECT_TRUE(has(message_of(frames, "map", "f1024"), "at most 64 frames above it"));
  ASSERT_TRUE(frames.add(moving("f0", "f1", 10, 1)));
  for (int i = 0; i < 2000; ++i) ASSERT_TRUE(frames.add(moving("f0", "f1", 20 + 0.001 * i, 1)));
  ASSERT_TRUE(frames.add(moving("f1", "f2", 21, 1)));
  EXPECT_TRUE(has(message_of(frames, "f0", "f2"), "known since"));  // the last 512 are kept
}

PoseDecoder decoder_of(const std::string& frame, const std::set<std::string>& sensors) {
  return PoseDecoder(
      {.protocol = PoseProtocol::ros, .osc = {}, .topic = "/tf", .frame = frame, .sensors = sensors});
}

TEST(RosFrames, ATrackerGetsEachNewPoseOfItsSensorsOnce) {
  PoseDecoder decoder = decoder_of("map", {"hand"});
  const auto decoded = [&](const RosPose& one) { return decoder.decoded(std::vector{one}).value(); };
  EXPECT_TRUE(decoded(moving("map", "base", 10, 1)).empty());
  EXPECT_TRUE(decoded(moving("map", "base", 10.1, 1)).empty());
  const auto first = decoded(fixed("base", "hand", 2));
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0].sensor, "hand");
  EXPECT_NEAR(first[0].time_s.value(), 10.1, 1e-6);
  EXPECT_TRUE(test::pose_near(first[0].feed_from_sensor, pose_at(1) * pose_at(2), 1e-6_deg, 1e-6));
  EXPECT_TRUE(decoded(fixed("map", "table", 2)).empty());         // not in its chain
  EXPECT_TRUE(decoded(moving("map", "base", 10.05, 1)).empty());  // between two that are known
  EXPECT_EQ(decoded(moving("map", "base", 10.2, 1)).size(), 1U);
  EXPECT_EQ(decoder.take_problem(), "");
}

TEST(RosFrames, ATrackerNamesWhatIsWrongAndGoesOn) {
  PoseDecoder decoder = decoder_of("map", {"hand", "foot"});
  RosPose broken = moving("map", "tail", 10, 1);
  broken.rotation_xyzw = {0, 0, 0, 0};
  EXPECT_EQ(decoder.decoded(std::vector{broken, moving("map", "hand", 10, 1)}).value().size(), 1U);
  EXPECT_TRUE(has(decoder.take_problem(), "'tail': expected a quaternion"));
  for (int i = 0; i < 30; ++i) {
    if (i < 10) {
      EXPECT_EQ(decoder.take_problem(), "");  // the chain may still come
    }
    EXPECT_EQ(decoder.decoded(std::vector{moving("map", "hand", 11 + i, 1)}).value().size(), 1U);
  }
  EXPECT_TRUE(has(decoder.take_problem(), "between the frames 'map' and 'foot', found a gap"));
  EXPECT_EQ(decoder.take_problem(), "");
}

}  // namespace
}  // namespace limn::exchange
