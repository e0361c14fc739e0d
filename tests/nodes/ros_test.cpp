// Poses to and from another program by the middleware of ROS 2, which is not installed here. The other
// program (ros_peer.cpp) uses Cyclone DDS alone.
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <set>
#include <thread>

#include "apps/live.h"
#include "core/file.h"
#include "nodes/ros_port.h"
#include "nodes/ros_sender.h"
#include "scene/scene.h"
#include "session/pose_feeds.h"
#include "tests/nodes/ros_peer_process.h"
#include "tests/support/matchers.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;
using namespace test::literals;
using session::FeedConfig;
using session::FeedInput;
using session::PoseFeeds;

using Peer = RosPeer;

FeedConfig feed_of(const std::string& topic, const std::string& sensor) {
  FeedConfig config;
  config.setup = {"mocap", {{sensor, "badge", std::nullopt}}, std::nullopt};
  config.decoder.protocol = exchange::PoseProtocol::ros;
  config.decoder.topic = topic;
  config.decoder.sensors = {sensor};
  return config;
}

// What comes from the other program until there are 5 poses of each feed and as many notes as wanted.
FeedInput received_from(PoseFeeds& feeds, std::size_t count, std::size_t notes) {
  FeedInput all;
  all.poses.resize(count);
  const auto is_enough = [&] {
    return all.notes.size() >= notes &&
           std::ranges::all_of(all.poses, [](const auto& poses) { return poses.size() >= 5; });
  };
  for (const Stamp end = now() + k_longest; now() < end && !is_enough();) {
    const FeedInput some = feeds.received(now(), true);
    for (std::size_t i = 0; i < count; ++i)
      all.poses[i].insert(all.poses[i].end(), some.poses[i].begin(), some.poses[i].end());
    all.notes.insert(all.notes.end(), some.notes.begin(), some.notes.end());
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return all;
}

// A busy machine can lose some.
testing::AssertionResult is_later_by_steps(const ForeignPose& first,
                                           const ForeignPose& second,
                                           double step_s) {
  const double steps = (second.time_s.value() - first.time_s.value()) / step_s;
  if (steps > 0.5 && std::abs(steps - std::round(steps)) < 1e-6) return testing::AssertionSuccess();
  return testing::AssertionFailure() << steps << " steps of " << step_s << " s";
}

TEST_F(Ros, PosesOfAnotherProgramArrive) {
  const Peer peer(domain, "publish");
  const auto port = open_ros_port();
  ASSERT_TRUE(port) << port.message();
  auto feeds = PoseFeeds::open({feed_of("/mocap/wand", "/mocap/wand"), feed_of("/tf", "wand")}, port->get());
  ASSERT_TRUE(feeds) << feeds.message();
  const FeedInput input = received_from(**feeds, 2, 0);
  const std::array<Pose, 2> expected = {Pose(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1, 2, 3}),
                                        Pose(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {-1, 2, 3})};
  for (std::size_t i = 0; i < 2; ++i) {
    ASSERT_GE(input.poses[i].size(), 5U);
    for (std::size_t k = 0; k < input.poses[i].size(); ++k) {
      const auto& [pose, arrived_at] = input.poses[i][k];
      EXPECT_EQ(pose.sensor, i == 0 ? "/mocap/wand" : "wand");
      EXPECT_TRUE(test::pose_near(pose.feed_from_sensor, expected[i], 1e-6_deg, 1e-9));
      ASSERT_TRUE(pose.time_s);
      EXPECT_GE(*pose.time_s, 100);
      if (k > 0) {
        EXPECT_GE(arrived_at, input.poses[i][k - 1].arrived_at);
        EXPECT_TRUE(is_later_by_steps(input.poses[i][k - 1].pose, pose, 0.02));
      }
    }
  }
  EXPECT_TRUE(input.notes.empty()) << input.notes[0];
}

TEST_F(Ros, PosesWithoutNumbersOrInAnotherFrameAreRefusedInWords) {
  const Peer peer(domain, "publish");
  const auto port = open_ros_port();
  ASSERT_TRUE(port) << port.message();
  auto feeds = PoseFeeds::open({feed_of("/mocap/nan", "/mocap/nan"), feed_of("/mocap/lost", "/mocap/lost")},
                               port->get());
  ASSERT_TRUE(feeds) << feeds.message();
  const FeedInput input = received_from(**feeds, 2, 2);
  for (const auto& poses : input.poses) {
    ASSERT_GE(poses.size(), 5U);
    for (std::size_t k = 1; k < poses.size(); ++k)  // every second one is missing
      EXPECT_TRUE(is_later_by_steps(poses[k - 1].pose, poses[k].pose, 0.04));
  }
  const auto has_note = [&](const std::string& words) {
    return std::ranges::any_of(input.notes,
                               [&](const std::string& note) { return note.find(words) != note.npos; });
  };
  EXPECT_TRUE(has_note("'/mocap/nan': expected coordinates"));
  EXPECT_TRUE(has_note("'/mocap/lost': frame_id: expected '"));
}

TEST_F(Ros, TransformsAreFollowedFromStaticOnesOn) {
  const Peer peer(domain, "arm");
  std::this_thread::sleep_for(std::chrono::milliseconds(200));  // comes after the static transform was sent
  const auto port = open_ros_port();
  ASSERT_TRUE(port) << port.message();
  FeedConfig config = feed_of("/tf", "hand");
  config.decoder.frame = "map";
  auto feeds = PoseFeeds::open({config}, port->get());
  ASSERT_TRUE(feeds) << feeds.message();
  const FeedInput input = received_from(**feeds, 1, 0);
  ASSERT_GE(input.poses[0].size(), 5U);
  const Eigen::Quaterniond turn(0.5, 0.5, -0.5, 0.5);
  for (const auto& [pose, arrived_at] : input.poses[0]) {
    EXPECT_EQ(pose.sensor, "hand");
    const Pose map_from_arm(turn, {pose.time_s.value() - 100, 2, 3}), arm_from_hand(turn, {0.25, 2, 3});
    EXPECT_TRUE(test::pose_near(pose.feed_from_sensor, map_from_arm * arm_from_hand, 1e-6_deg, 1e-6));
  }
  EXPECT_TRUE(input.notes.empty()) << input.notes[0];
}

// ---- out ----

void append(std::string* hex, const void* bytes, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i)
    *hex += fmt::format("{:02x}", static_cast<const unsigned char*>(bytes)[i]);
}

// What a PoseStamped of the frame limn_world looks like in little-endian CDR (OMG CORBA 3.3, 9.3) behind its
// 4 bytes of encapsulation (DDSI-RTPS 2.5, 10.2), from behind its stamp.
std::string expected_hex(const std::array<double, 7>& numbers) {
  std::string hex =
      "0b000000"
      "6c696d6e5f776f726c6400"
      "00";  // length with the zero, text, padding to 24
  append(&hex, numbers.data(), sizeof(numbers));
  return hex;
}

std::vector<ForeignPose> some_poses() {
  ForeignPose badge{"badge", Pose(Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1.25, -2, 3}), true, false, 10.5};
  ForeignPose hidden{"hidden", {}, true, true, 10.5};
  ForeignPose viewer{"viewer 1", Pose(Eigen::Quaterniond::Identity(), {0, -2, 1}), true, false, 10.5};
  return {badge, hidden, viewer};
}

// Publishes until the other program has printed a PoseStamped and `count` other lines, which are returned.
std::set<std::string> lines_after_publishing(Peer& peer,
                                             exchange::RosPort* port,
                                             std::size_t count,
                                             std::string* cdr) {
  std::set<std::string> printed;
  for (const Stamp end = now() + k_longest; now() < end && (cdr->empty() || printed.size() < count);) {
    const Status published = publish_poses(some_poses(), shifted({}, 10), port);
    EXPECT_TRUE(published) << published.message();
    for (const std::string& line : peer.lines()) {
      if (line.starts_with("cdr ")) *cdr = line.substr(4);
      if (!line.starts_with("cdr ")) printed.insert(line);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return printed;
}

TEST_F(Ros, PosesArriveThereUnderItsNamesAndInItsBytes) {
  Peer peer(domain, "listen");
  const auto port = open_ros_port();
  ASSERT_TRUE(port) << port.message();
  std::string cdr;
  const auto printed = lines_after_publishing(peer, port->get(), 5, &cdr);
  const std::string pose = " geometry_msgs::msg::dds_::PoseStamped_ reliable volatile";
  EXPECT_EQ(printed,
            (std::set<std::string>{
                "writer rt/limn/poses/badge" + pose,
                "writer rt/limn/poses/viewer_1" + pose,
                "writer rt/tf tf2_msgs::msg::dds_::TFMessage_ reliable volatile",
                "tf limn_world limn/badge 1.250000000 -2.000000000 3.000000000 0.500000000 -0.500000000 "
                "0.500000000 "
                "0.500000000",
                "tf limn_world limn/viewer_1 0.000000000 -2.000000000 1.000000000 0.000000000 0.000000000 "
                "0.000000000 1.000000000",
            }));
  constexpr std::size_t k_stamp_at = 8, k_stamp_digits = 16;
  ASSERT_GT(cdr.size(), k_stamp_at + k_stamp_digits);
  EXPECT_EQ(cdr.substr(0, k_stamp_at), "00010000");  // CDR, little-endian
  EXPECT_EQ(cdr.substr(k_stamp_at + k_stamp_digits), expected_hex({1.25, -2, 3, 0.5, -0.5, 0.5, 0.5}));
  // The light appears half a second after the present.
  std::uint32_t s = 0;
  for (std::size_t i = 4; i-- > 0;)
    s = s * 256 + static_cast<std::uint32_t>(std::stoul(cdr.substr(k_stamp_at + 2 * i, 2), nullptr, 16));
  const auto now_s = std::chrono::system_clock::now().time_since_epoch() / std::chrono::seconds(1);
  EXPECT_NEAR(static_cast<double>(s), static_cast<double>(now_s), 3);
}

TEST_F(Ros, ASessionPublishesAtEachFrame) {
  Peer peer(domain, "listen");
  apps::LiveOptions options;
  options.resolution = 0.25;
  options.seconds = 2;
  options.is_real_time = true;
  options.poses_out = {"ros"};
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();
  EXPECT_TRUE(peer.has_printed(
      [](const std::string& line) { return line.starts_with("tf limn_world limn/prototype "); }));
}

// ---- settings ----

TEST_F(Ros, AWrongDomainIsNamed) {
  for (const char* wrong : {"-1", "233", "zero", "1 "}) {
    ::setenv("ROS_DOMAIN_ID", wrong, 1);
    const auto port = open_ros_port();
    ASSERT_FALSE(port) << wrong;
    EXPECT_NE(port.message().find("ROS_DOMAIN_ID: expected a number from 0 to 232"), std::string::npos);
  }
}

TEST_F(Ros, TheTrackersFileNamesTopics) {
  const auto scene = scene::load_scene(fs::path(LIMN_SOURCE_DIR) / "config/scenes/balls");
  ASSERT_TRUE(scene) << scene.message();
  const auto message_of = [&](const std::string& receive, const std::string& sensor,
                              const std::string& more) {
    const fs::path file = test::test_folder() / "trackers.json";
    const std::string text = fmt::format(
        R"({{"schema": "limn.trackers/1", "trackers": [{{"name": "mocap", "protocol": "ros", "receive": "{}",)"
        R"( {} "bodies": {{"{}": "badge"}}}}]}})",
        receive, more, sensor);
    EXPECT_TRUE(write_file(file, text));
    const auto feeds = session::load_feeds(file, *scene);
    return feeds ? "topic " + (*feeds)[0].decoder.topic : feeds.message();
  };
  EXPECT_EQ(message_of("/tf", "wand", ""), "topic /tf");
  EXPECT_EQ(message_of("/mocap/wand_1", "/mocap/wand_1", ""), "topic /mocap/wand_1");
  EXPECT_NE(message_of("/mocap/wand", "wand", "").find("expected the topic '/mocap/wand' as the only sensor"),
            std::string::npos);
  for (const char* wrong : {"tf", "/", "/a//b", "/a/", "/1a", "/a b", ""})
    EXPECT_NE(message_of(wrong, "wand", "").find("receive: expected the absolute name"), std::string::npos)
        << wrong;
  EXPECT_EQ(message_of("/tf", "wand", "\"frame\": \"map\","), "topic /tf");
  EXPECT_NE(message_of("/tf", "map", "\"frame\": \"map\",").find("expected another frame than 'map' itself"),
            std::string::npos);
  EXPECT_NE(message_of("/a", "/a", "\"frame\": \"map\",").find("that the topic carries transforms"),
            std::string::npos);
  EXPECT_NE(message_of("/tf_static", "wand", "").find("expected a topic such as /tf"), std::string::npos);
  EXPECT_NE(message_of("/tf", "wand", "\"from\": \"127.0.0.1\",").find("without the protocol ros"),
            std::string::npos);
}

}  // namespace
}  // namespace limn::nodes
