#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "exchange/poses/free_d.h"
#include "exchange/poses/osc_message.h"
#include "exchange/poses/pose_decoder.h"
#include "exchange/poses/pose_json.h"
#include "exchange/poses/pose_limits.h"
#include "exchange/poses/pose_osc.h"
#include "exchange/poses/posi_stage_net.h"
#include "exchange/poses/ros_pose.h"
#include "tests/support/matchers.h"
#include "tests/support/random.h"

namespace limn::exchange {
namespace {

using namespace test::literals;
using Bytes = std::vector<std::uint8_t>;
using Eigen::Quaterniond;
using Eigen::Vector3d;

Pose some_pose(std::mt19937_64& rng) {
  const auto vector = [&](double most) {
    return Vector3d(test::uniform(rng, -most, most), test::uniform(rng, -most, most),
                    test::uniform(rng, -most, most));
  };
  return {exp_rotation(vector(1.8)), vector(20)};
}

// ---- FreeD ----

// Written by hand from appendix A of the manual: camera 5; pan 90, tilt -45, roll 0 degrees; x 1000, y -2000,
// z 1500.5 mm.
const Bytes k_free_d = {0xD1, 0x05, 0x2D, 0x00, 0x00, 0xE9, 0x80, 0x00, 0x00, 0x00,
                        0x00, 0x00, 0xFA, 0x00, 0xFE, 0x0C, 0x00, 0x01, 0x77, 0x20,
                        0,    0,    0,    0,    0,    0,    0,    0,    0x38};

TEST(FreeD, ReadsAMessageWrittenByHand) {
  const auto pose = pose_of_free_d(k_free_d);
  ASSERT_TRUE(pose) << pose.message();
  EXPECT_EQ(pose->sensor, "5");
  EXPECT_TRUE(pose->feed_from_sensor.translation.isApprox(Vector3d(1, -2, 1.5005), 1e-12))
      << pose->feed_from_sensor.translation.transpose();
  // The camera has turned to the right, from y to x, and looks down by 45 degrees.
  const Vector3d forward = pose->feed_from_sensor.rotation * Vector3d::UnitY();
  EXPECT_TRUE(forward.isApprox(Vector3d(std::sqrt(0.5), 0, -std::sqrt(0.5)), 1e-12)) << forward.transpose();
  const Vector3d right = pose->feed_from_sensor.rotation * Vector3d::UnitX();
  EXPECT_TRUE(right.isApprox(-Vector3d::UnitY(), 1e-12)) << right.transpose();
}

TEST(FreeD, RollIsClockwiseFromBehind) {
  const auto bytes = free_d_message(1, Pose(exp_rotation({0, 30 * std::numbers::pi / 180, 0}), {0, 0, 0}));
  ASSERT_TRUE(bytes) << bytes.message();
  EXPECT_EQ(Bytes(bytes->begin() + 8, bytes->begin() + 11), (Bytes{0x0F, 0x00, 0x00}));  // +30 degrees
  // From behind, along y with z up, x is to the right: clockwise takes the camera's top to the right.
  const Vector3d top = pose_of_free_d(*bytes)->feed_from_sensor.rotation * Vector3d::UnitZ();
  EXPECT_NEAR(top.x(), 0.5, 1e-9);
}

TEST(FreeD, PosesComeBack) {
  auto rng = test::test_rng();
  for (int i = 0; i < 300; ++i) {
    Pose pose = some_pose(rng);
    if (i % 10 == 0)
      pose.rotation = exp_rotation({std::numbers::pi / 2, 0, 0}) * exp_rotation({0, 0, 0.3 * i});
    const auto bytes = free_d_message(i % 256, pose);
    ASSERT_TRUE(bytes) << bytes.message();
    const auto back = pose_of_free_d(*bytes);
    ASSERT_TRUE(back) << back.message();
    EXPECT_EQ(back->sensor, std::to_string(i % 256));
    EXPECT_LT((back->feed_from_sensor.translation - pose.translation).cwiseAbs().maxCoeff(),
              0.5e-3 / 64 + 1e-9);
    EXPECT_LT(angle_between(back->feed_from_sensor.rotation, pose.rotation), 6e-5) << i;
  }
}

TEST(FreeD, RefusesWhatIsNoMessage) {
  const Bytes good = *free_d_message(5, Pose());
  const auto refusal = [](const Bytes& bytes) {
    const auto pose = pose_of_free_d(bytes);
    return pose ? "read" : pose.message();
  };
  EXPECT_NE(refusal(Bytes(good.begin(), good.end() - 1)).find("29 bytes, found 28"), std::string::npos);
  EXPECT_NE(refusal({}).find("found 0"), std::string::npos);
  Bytes other = good;
  other[0] = 0xD2;
  EXPECT_NE(refusal(other).find("type D2"), std::string::npos);
  other = good;
  other[12] ^= 1;
  EXPECT_NE(refusal(other).find("checksum"), std::string::npos);
  other = good;
  other[2] = 0x7F;  // 254 degrees
  other.back() = static_cast<std::uint8_t>(other.back() - 0x7F);
  EXPECT_NE(refusal(other).find("180 degrees"), std::string::npos);
  EXPECT_NE(free_d_message(0, Pose(Quaterniond::Identity(), {132, 0, 0})).message().find("131 m"),
            std::string::npos);
  EXPECT_FALSE(free_d_message(256, Pose()));
}

// ---- PosiStageNet ----

// Written by hand from the protocol's description, 2.03: version 2.3, frame 7 of 1 packet, sent after 1 s;
// tracker 258 at (1, 2, 3) m, turned by pi/2 about y, valid, measured after 0.5 s.
const Bytes k_psn = {0x55, 0x67, 0x4C, 0x80,  // data packet, 76 bytes
                     0x00, 0x00, 0x0C, 0x00, 0x40, 0x42, 0x0F, 0,    0,    0,    0,    0,
                     0x02, 0x03, 0x07, 0x01,  // header
                     0x01, 0x00, 0x38, 0x80,  // tracker list, 56 bytes
                     0x02, 0x01, 0x34, 0x80,  // tracker 258, 52 bytes
                     0x00, 0x00, 0x0C, 0x00, 0,    0,    0x80, 0x3F, 0,    0,    0,    0x40,
                     0,    0,    0x40, 0x40,  // position
                     0x02, 0x00, 0x0C, 0x00, 0,    0,    0,    0,    0xDB, 0x0F, 0xC9, 0x3F,
                     0,    0,    0,    0,                                                   // orientation
                     0x03, 0x00, 0x04, 0x00, 0,    0,    0x80, 0x3F,                        // status
                     0x06, 0x00, 0x08, 0x00, 0x20, 0xA1, 0x07, 0,    0,    0,    0,    0};  // timestamp

TEST(PosiStageNet, ReadsAPacketWrittenByHand) {
  const auto packet = psn_packet(k_psn);
  ASSERT_TRUE(packet) << packet.message();
  EXPECT_EQ(packet->sent_at_s, 1);
  EXPECT_EQ(packet->frame, 7);
  ASSERT_EQ(packet->poses.size(), 1U);
  const ForeignPose& pose = packet->poses[0];
  EXPECT_EQ(pose.sensor, "258");
  EXPECT_EQ(pose.time_s, 0.5);
  EXPECT_FALSE(pose.is_lost);
  // The left-handed frame becomes right-handed by turning z round: away is -z.
  EXPECT_EQ(pose.feed_from_sensor.translation, Vector3d(1, 2, -3));
  // In a left-handed frame a turn about y takes z (away) to x (right).
  const Vector3d away = pose.feed_from_sensor.rotation * -Vector3d::UnitZ();
  EXPECT_TRUE(away.isApprox(Vector3d::UnitX(), 1e-6)) << away.transpose();
}

TEST(PosiStageNet, AMirroredMotionStaysAMotion) {
  auto rng = test::test_rng();
  for (int i = 0; i < 50; ++i) {
    const Pose a = some_pose(rng), b = some_pose(rng);
    EXPECT_TRUE(test::pose_near(mirrored(a * b), mirrored(a) * mirrored(b), 1e-7_deg, 1e-9));
    EXPECT_TRUE(test::pose_near(mirrored(mirrored(a)), a, 1e-7_deg, 1e-9));
  }
}

TEST(PosiStageNet, PosesAndNamesComeBackInPacketsOfTheAllowedSize) {
  auto rng = test::test_rng();
  std::vector<PsnTracker> trackers;
  for (std::uint16_t i = 0; i < 70; ++i)
    trackers.push_back({i, "tracker " + std::to_string(i), some_pose(rng), i % 7 == 3});
  std::vector<ForeignPose> poses;
  const auto packets = psn_data(trackers, 12.5, 200);
  EXPECT_EQ(packets.size(), 3U);
  for (const Bytes& bytes : packets) {
    EXPECT_LE(bytes.size(), 1500U);
    const auto packet = psn_packet(bytes);
    ASSERT_TRUE(packet) << packet.message();
    EXPECT_EQ(packet->packets_of_frame, 3);
    poses.insert(poses.end(), packet->poses.begin(), packet->poses.end());
  }
  ASSERT_EQ(poses.size(), trackers.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_TRUE(test::pose_near(poses[i].feed_from_sensor, trackers[i].room_from_sensor, 1e-4_deg, 1e-5));
    EXPECT_EQ(poses[i].is_lost, trackers[i].is_lost);
    EXPECT_EQ(poses[i].time_s, 12.5);
  }
  std::map<std::uint16_t, std::string> names;
  for (const Bytes& bytes : psn_info(trackers, 12.5, 200)) names.merge(psn_packet(bytes)->names);
  EXPECT_EQ(names.size(), trackers.size());
  EXPECT_EQ(names[42], "tracker 42");
}

TEST(PosiStageNet, RefusesDamagedPackets) {
  const auto refusal = [](Bytes bytes, std::size_t at, std::initializer_list<int> values) {
    for (const int value : values) bytes[at++] = static_cast<std::uint8_t>(value);
    const auto packet = psn_packet(bytes);
    return packet ? "read" : packet.message();
  };
  EXPECT_NE(refusal(k_psn, 0, {0x54}).find("6754"), std::string::npos);  // version 1
  EXPECT_NE(refusal(k_psn, 16, {0x03}).find("version 2, found 3"), std::string::npos);
  EXPECT_NE(refusal(k_psn, 2, {0xFF}).find("255 bytes"), std::string::npos);  // longer than it is
  EXPECT_NE(refusal(k_psn, 26, {0x50}).find("80 bytes"), std::string::npos);
  EXPECT_NE(refusal(k_psn, 34, {0xC0, 0x7F}).find("tracker 258"), std::string::npos);  // NaN
  EXPECT_NE(refusal(k_psn, 50, {0x80, 0x7F}).find("orientation"), std::string::npos);  // infinite
  for (std::size_t length = 0; length < k_psn.size(); ++length)
    EXPECT_FALSE(psn_packet(std::span(k_psn).first(length))) << length;
  EXPECT_FALSE(psn_packet(Bytes(9001, 0)));
}

// A tracker without an orientation, as systems of beacons send it, and one that is not tracked.
TEST(PosiStageNet, StatesWhatATrackerDoesNotSay) {
  Bytes bytes = k_psn;
  bytes[44] = 0x77;  // an unknown chunk instead of the orientation
  EXPECT_FALSE(psn_packet(bytes)->poses[0].has_rotation);
  bytes[66] = 0;
  bytes[67] = 0;
  EXPECT_TRUE(psn_packet(bytes)->poses[0].is_lost);
}

// ---- JSON ----

TEST(PoseJson, ReadsTheDocumentedForm) {
  const auto poses = poses_of_json(
      R"({"tracker": "lab", "time_s": 3.5, "more": 1, "poses": [
          {"name": "wand", "position_m": [1, 2, 3], "rotation_wxyz": [0, 0, 2, 0], "stddev_mm": 0.5,
           "stddev_deg": 0.1},
          {"name": "hat", "lost": true}, {"name": "beacon", "position_m": [0, 0, 1]}]})");
  ASSERT_TRUE(poses) << poses.message();
  ASSERT_EQ(poses->size(), 3U);
  const ForeignPose& wand = (*poses)[0];
  EXPECT_EQ(wand.sensor, "wand");
  EXPECT_EQ(wand.time_s, 3.5);
  EXPECT_EQ(wand.feed_from_sensor.translation, Vector3d(1, 2, 3));
  EXPECT_EQ(wand.feed_from_sensor.rotation.y(), 1);
  EXPECT_NEAR(*wand.stddev_m, 0.5e-3, 1e-12);
  EXPECT_NEAR(*wand.stddev_rad, 0.1 * std::numbers::pi / 180, 1e-12);
  EXPECT_TRUE((*poses)[1].is_lost);
  EXPECT_FALSE((*poses)[2].has_rotation);
  EXPECT_EQ(poses_of_json(R"([{"poses": []}, {"poses": [{"name": "a", "position_m": [0, 0, 0]}]}])")->size(),
            1U);
}

TEST(PoseJson, PosesComeBack) {
  auto rng = test::test_rng();
  std::vector<ForeignPose> sent;
  for (int i = 0; i < 20; ++i) {
    ForeignPose pose{"body " + std::to_string(i), some_pose(rng)};
    pose.is_lost = i % 5 == 4;
    pose.time_s = 7.25;
    pose.stddev_m = 0.7e-3;
    sent.push_back(pose);
  }
  const auto back = poses_of_json(json_of_poses("Limn", sent));
  ASSERT_TRUE(back) << back.message();
  ASSERT_EQ(back->size(), sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_EQ((*back)[i].sensor, sent[i].sensor);
    EXPECT_EQ((*back)[i].is_lost, sent[i].is_lost);
    EXPECT_EQ((*back)[i].time_s, 7.25);
    if (sent[i].is_lost) continue;
    EXPECT_TRUE(test::pose_near((*back)[i].feed_from_sensor, sent[i].feed_from_sensor, 1e-7_deg, 1e-9));
    EXPECT_NEAR(*(*back)[i].stddev_m, 0.7e-3, 1e-12);
  }
}

TEST(PoseJson, RefusesOtherBytes) {
  const auto refusal = [](const std::string& text) {
    const auto poses = poses_of_json(text);
    return poses ? "read" : poses.message();
  };
  EXPECT_NE(refusal("{").find("expected JSON"), std::string::npos);
  EXPECT_NE(refusal("3").find("list \"poses\""), std::string::npos);
  EXPECT_NE(refusal(R"({"poses": [{"position_m": [0, 0, 0]}]})").find("name"), std::string::npos);
  EXPECT_NE(refusal(R"({"poses": [{"name": "a"}]})").find("position_m"), std::string::npos);
  EXPECT_NE(refusal(R"({"poses": [{"name": "a", "position_m": [0, 0, null]}]})").find("3 numbers"),
            std::string::npos);
  EXPECT_NE(refusal(R"({"poses": [{"name": "a", "position_m": [0, 0, 1e300]}]})").find("at most"),
            std::string::npos);
  EXPECT_NE(refusal(R"({"poses": [{"name": "a", "position_m": [0, 0, NaN]}]})").find("expected JSON"),
            std::string::npos);
  EXPECT_NE(refusal(R"({"poses": [{"name": "a", "position_m": [0, 0, 0], "rotation_wxyz": [0, 0, 0, 0]}]})")
                .find("quaternion"),
            std::string::npos);
  EXPECT_NE(refusal(R"({"time_s": "now", "poses": []})").find("time_s"), std::string::npos);
  EXPECT_NE(refusal(R"({"poses": [{"name": "a", "position_m": [0, 0, 0], "stddev_mm": -1}]})").find("over 0"),
            std::string::npos);
  EXPECT_NE(refusal(std::string(4000, '[')).find("levels"), std::string::npos);
  std::string many = R"({"poses": [{"name": "a", "lost": true})";
  for (int i = 0; i < 300; ++i) many += R"(,{"name":"a","lost":true})";
  EXPECT_NE(refusal(many + "]}").find("256"), std::string::npos);
}

// ---- OSC ----

TEST(PoseOsc, ReadsLimnsFormAndThoseOfOthers) {
  const std::vector<OscValue> pose = {100.F, -200.F, 300.F, 0.F, 1.F, 0.F, 0.F};
  std::vector<OscValue> named = pose;
  named.insert(named.begin(), std::string("wand"));
  for (const char* path : {"/limn/pose", "/limn/state/pose"}) {
    const auto read = poses_of_osc(osc_message(path, named));
    ASSERT_TRUE(read) << read.message();
    ASSERT_EQ(read->size(), 1U) << path;
    EXPECT_EQ((*read)[0].sensor, "wand");
    EXPECT_TRUE((*read)[0].feed_from_sensor.translation.isApprox(Vector3d(0.1, -0.2, 0.3), 1e-9));
    EXPECT_EQ((*read)[0].feed_from_sensor.rotation.x(), 1);
  }
  EXPECT_EQ((*poses_of_osc(osc_message("/limn/state/prototype", pose)))[0].sensor, "prototype");
  EXPECT_TRUE((*poses_of_osc(osc_message("/limn/lost", {std::string("wand")})))[0].is_lost);
  const auto metres = poses_of_osc(osc_message("/tracker/hat/pose", {1.F, 2.F, 3.F, 0.F, 0.F, 1.F, 0.F, 4.F}),
                                   {.unit_m = 1, .has_real_part_last = true});
  ASSERT_TRUE(metres) << metres.message();
  EXPECT_EQ((*metres)[0].sensor, "hat");
  EXPECT_EQ((*metres)[0].feed_from_sensor.translation, Vector3d(1, 2, 3));
  EXPECT_EQ((*metres)[0].feed_from_sensor.rotation.z(), 1);
  EXPECT_EQ((*metres)[0].time_s, 4);
  const auto place = poses_of_osc(osc_message("/a/b/7/position", {1.F, 2.F, 3.F}));
  EXPECT_EQ((*place)[0].sensor, "7");
  EXPECT_FALSE((*place)[0].has_rotation);
  EXPECT_TRUE(poses_of_osc(osc_message("/limn/next_variant", {std::string("mirror")}))->empty());
  EXPECT_TRUE(poses_of_osc(osc_message("/limn/state/looks", {0, 0, std::string()}))->empty());
}

Bytes bundle_of(const std::vector<Bytes>& parts, std::uint32_t seconds) {
  Bytes bytes = {'#', 'b', 'u', 'n', 'd', 'l', 'e', 0};
  const auto add = [&](std::uint32_t value) {
    for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
  };
  add(seconds);
  add(0x80000000);
  for (const Bytes& part : parts) {
    add(static_cast<std::uint32_t>(part.size()));
    bytes.insert(bytes.end(), part.begin(), part.end());
  }
  return bytes;
}

TEST(PoseOsc, ReadsBundlesWithTheirTime) {
  const Bytes a = osc_message("/x/a/position", {1.F, 2.F, 3.F}),
              b = osc_message("/x/b/position", {1.F, 2.F, 3.F});
  const auto read = poses_of_osc(bundle_of({a, bundle_of({b}, 11)}, 10));
  ASSERT_TRUE(read) << read.message();
  ASSERT_EQ(read->size(), 2U);
  EXPECT_EQ((*read)[0].time_s, 10.5);
  EXPECT_EQ((*read)[1].time_s, 11.5);
  EXPECT_FALSE(poses_of_osc(bundle_of({bundle_of({bundle_of({a}, 1)}, 1)}, 1)));
  Bytes cut = bundle_of({a}, 10);
  cut.pop_back();
  EXPECT_FALSE(poses_of_osc(cut));
}

TEST(PoseOsc, RefusesOtherArguments) {
  const auto refusal = [](const std::string& path, const std::vector<OscValue>& arguments) {
    const auto poses = poses_of_osc(osc_message(path, arguments));
    return poses ? "read" : poses.message();
  };
  EXPECT_NE(refusal("/limn/pose", {1.F}).find("name"), std::string::npos);
  EXPECT_NE(refusal("/limn/pose", {std::string("a"), 1.F}).find("7 finite"), std::string::npos);
  const float nan = std::nanf("");
  EXPECT_NE(refusal("/t/a/pose", {nan, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F}).find("finite"), std::string::npos);
  EXPECT_NE(refusal("/t/a/pose", {0.F, 0.F, 0.F, 0.F, 0.F, 0.F, 0.F}).find("quaternion"), std::string::npos);
  EXPECT_NE(refusal("/t/a/pose", {1e30F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F}).find("at most"), std::string::npos);
  EXPECT_FALSE(poses_of_osc(Bytes{1, 2, 3}));
}

// ---- ROS 2 ----

RosPose good_ros_pose() { return {"map", "wand", 12, 500'000'000, {1, 2, 3}, {0, 0, 0.6, 0.8}}; }

TEST(RosPose, GoesOutAndComesInAgain) {
  std::mt19937_64 rng(5);
  for (int i = 0; i < 50; ++i) {
    const ForeignPose sent{"hat", some_pose(rng)};
    const auto back = pose_of_ros(ros_pose(sent, "map", "hat", 1'700'000'000'250'000'000));
    ASSERT_TRUE(back) << back.message();
    EXPECT_EQ(back->sensor, "hat");
    EXPECT_TRUE(test::pose_near(back->feed_from_sensor, sent.feed_from_sensor, 1e-6_deg, 1e-12));
    EXPECT_NEAR(back->time_s.value_or(0), 1'700'000'000.25, 1e-6);
  }
  RosPose without_time = good_ros_pose();
  without_time.s = 0;
  without_time.ns = 0;
  EXPECT_FALSE(pose_of_ros(without_time)->time_s);
}

TEST(RosPose, WhatCannotBeIsRefusedInWords) {
  const auto message_of = [](auto change) {
    RosPose pose = good_ros_pose();
    change(pose);
    const auto read = pose_of_ros(pose);
    return read ? "read" : read.message();
  };
  EXPECT_EQ(message_of([](RosPose&) {}), "read");
  const auto is_refused = [&](auto change, const std::string& words) {
    EXPECT_NE(message_of(change).find("ROS 2 pose of '" + words), std::string::npos) << message_of(change);
  };
  constexpr double k_nan = std::numeric_limits<double>::quiet_NaN();
  is_refused([](RosPose& pose) { pose.position_m[2] = k_nan; }, "wand': expected coordinates");
  is_refused([](RosPose& pose) { pose.position_m[0] = 1e9; }, "wand': expected coordinates");
  is_refused([](RosPose& pose) { pose.rotation_xyzw[3] = k_nan; }, "wand': expected a quaternion");
  is_refused([](RosPose& pose) { pose.rotation_xyzw = {0, 0, 0, 0}; }, "wand': expected a quaternion");
  is_refused([](RosPose& pose) { pose.frame = ""; }, "wand': frame_id: expected the name");
  is_refused([](RosPose& pose) { pose.frame = std::string(256, 'a'); }, "wand': frame_id: expected the name");
  is_refused([](RosPose& pose) { pose.frame = "a\nb"; }, "wand': frame_id: expected the name");
  is_refused([](RosPose& pose) { pose.sensor = "\xff"; }, "?': child_frame_id: expected the name");
  is_refused([](RosPose& pose) { pose.frame = "wand"; }, "wand': expected a pose in another frame");
  is_refused([](RosPose& pose) { pose.ns = 1'000'000'000; }, "wand': stamp");
}

TEST(RosPose, ATrackerHasOneFrameAndNotTooManyPoses) {
  PoseDecoder decoder({.protocol = PoseProtocol::ros, .osc = {}, .topic = "/tf", .sensors = {"wand"}});
  RosPose other = good_ros_pose(), moved = good_ros_pose();
  other.sensor = "other";
  other.frame = "odom";
  other.position_m[0] = std::numeric_limits<double>::infinity();
  moved.frame = "odom";
  const auto first = decoder.decoded(std::vector{other, good_ros_pose()});
  ASSERT_TRUE(first) << first.message();
  EXPECT_EQ(first->size(), 1U);
  EXPECT_NE(
      decoder.decoded(std::vector{moved}).message().find("frame_id: expected 'map', as before, found 'odom'"),
      std::string::npos);
  EXPECT_TRUE(decoder.decoded(std::vector(256, good_ros_pose())));
  EXPECT_NE(decoder.decoded(std::vector(257, good_ros_pose())).message().find("at most 256"),
            std::string::npos);
}

TEST(RosPose, NamesOfBodiesBecomeNamesOfTopics) {
  const std::vector<std::string> names = {"mirror",     "viewer 1",     "viewer_1", "1st",
                                          "T\xc3\xbcr", "\xe6\x89\x89", "a__b"};
  const std::vector<std::string> expected = {"mirror", "viewer_1", "viewer_1_2", "body_1st",
                                             "T_r",    "body_",    "a_b"};
  EXPECT_EQ(ros_names(names), expected);
  for (const std::string& name : ros_names(names))
    EXPECT_TRUE(check_ros_topic("/limn/poses/" + name)) << name;
}

}  // namespace
}  // namespace limn::exchange
