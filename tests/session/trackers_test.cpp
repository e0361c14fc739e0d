// Other tracking systems in a session (a feeder sends poses over the loopback interface), and cameras whose
// images are searched elsewhere.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <filesystem>

#include "apps/live.h"
#include "apps/replay.h"
#include "core/file.h"
#include "core/scale_resolution.h"
#include "device/gl_context.h"
#include "device/udp_socket.h"
#include "exchange/poses/free_d.h"
#include "exchange/poses/pose_json.h"
#include "exchange/poses/posi_stage_net.h"
#include "session/pose_feeds.h"
#include "session/pose_sender.h"
#include "session/requests/script.h"
#include "session/virtual_session.h"
#include "sim/virtual_rig.h"
#include "tests/session/studio.h"
#include "tests/support/matchers.h"
#include "tracker/camera_encoding.h"

namespace limn::session {
namespace {

namespace fs = std::filesystem;
using namespace test::literals;
using nlohmann::json;

constexpr double k_hidden_s = 9, k_end_s = 11;

// People turn and shift the mirror's marker every 0.35 s. A hand covers it from k_hidden_s on, and under the
// hand it is moved once more.
fs::path script_in(const fs::path& folder) {
  json events = json::array();
  for (int i = 0; i < 25; ++i) {
    const Eigen::Vector3d turn(0.3 * std::sin(1.9 * i), 0.3 * std::sin(2.7 * i + 1), 0.5 * std::sin(1.3 * i));
    const Eigen::Quaterniond q = exp_rotation(turn);
    events.push_back({{"at_s", i < 24 ? 0.35 * (i + 1) : k_hidden_s + 0.4},
                      {"move", k_mirror},
                      {"home_from_marker",
                       {{"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                        {"translation_m", {0.03 * std::sin(1.1 * i), 0.03 * std::cos(2.3 * i), -0.02}}}}});
  }
  events.push_back({{"at_s", k_hidden_s}, {"until_s", k_end_s + 1}, {"cover", k_mirror}});
  return write_json(folder / "script.json", script_of(k_end_s, events));
}

// Another system, with its own frame and clock, whose sensor is mounted beside the marker. It sends
// PosiStageNet, 60 ms late.
class Feeder final : public SessionClient {
 public:
  Feeder(const ScriptedRoom* room, device::UdpSocket socket) : room_(room), socket_(std::move(socket)) {}

  void apply_edits(const SessionMoment&) override {}
  void publish_state(const SessionMoment& moment) override {
    for (; next_s_ + 0.06 <= seconds_of(moment.at); next_s_ += 1 / 60.0) {
      const Pose world_from_body = room_->world_from_marker(MarkerName::parse(k_mirror).value(), next_s_);
      const exchange::PsnTracker tracker{7, "mirror", feed_from_world_ * world_from_body * body_from_sensor_};
      if (is_silent) continue;
      for (const auto& packet : exchange::psn_info({&tracker, 1}, 100 + next_s_, 0)) socket_.send(packet);
      for (const auto& packet : exchange::psn_data({&tracker, 1}, 100 + next_s_, 0)) socket_.send(packet);
    }
    check(moment);
  }

  // Compares the tracks of the marker while it is hidden with the truth.
  void check(const SessionMoment& moment) {
    const ComposedFrame& composed = moment.session.composed();
    const double shown_s = seconds_of(composed.shown_at);
    if (shown_s < k_hidden_s + 1.2) return;  // a jump looks like fast motion at first
    for (const Track& track : composed.tracks) {
      if (track.body != "mirror") continue;
      const Pose truth = room_->world_from_marker(MarkerName::parse(k_mirror).value(), shown_s);
      ++compared;
      lost += track.tracking == TrackingState::lost;
      worst_mm = std::max(worst_mm, 1e3 * (track.world_from_body.translation - truth.translation).norm());
      worst_rad = std::max(worst_rad, angle_between(track.world_from_body.rotation, truth.rotation));
    }
    for (const auto& part : composed.posed.parts) shown += part.slot == "mirror";
  }

  bool is_silent = false;
  int compared = 0, lost = 0, shown = 0;
  double worst_mm = 0, worst_rad = 0;

 private:
  const ScriptedRoom* room_;
  device::UdpSocket socket_;
  double next_s_ = 0;
  Pose feed_from_world_{exp_rotation({0.4, -1.1, 0.7}), {1, -2, 0.5}};
  Pose body_from_sensor_{exp_rotation({0.2, 0.5, -0.4}), {0.03, -0.02, 0.05}};
};

TEST(Trackers, AHiddenMarkersPartGoesOnInTheRightPlaceAndIsReplayed) {
  const fs::path folder = test::test_folder();
  sim::World world = studio_world(0.6);
  SessionSetup setup;
  setup.rig = world.rig;
  setup.scene = *world.scene;
  sim::VirtualRig rig(std::move(world), virtual_rig_options(1 / 15.0));
  auto script = load_script(script_in(folder));
  ASSERT_TRUE(script) << script.message();
  auto room = ScriptedRoom::create(std::move(*script), &rig);
  ASSERT_TRUE(room) << room.message();
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  FeedConfig config;
  config.setup = {"stage", {{"mirror", "mirror", std::nullopt}}, std::nullopt};
  config.decoder.protocol = exchange::PoseProtocol::psn;
  config.decoder.sensors = {"mirror"};
  config.receive = {"127.0.0.1", "0"};
  setup.watch.feeds = {config.setup};
  auto feeds = PoseFeeds::open({config});
  ASSERT_TRUE(feeds) << feeds.message();
  auto socket = device::UdpSocket::sending({"127.0.0.1", std::to_string((*feeds)->port(0))});
  ASSERT_TRUE(socket);
  Feeder feeder(&*room, std::move(*socket));
  {
    auto output = SessionOutput::open(folder / "out", folder / "recording", &setup);
    ASSERT_TRUE(output) << output.message();
    auto perception = Perception::create(setup.scene, setup.rig, setup.watch);
    auto session = Session::create(setup, &output->telemetry(), output->recorder(), false);
    ASSERT_TRUE(perception && session);
    const std::atomic<bool> is_ended = false;
    const Status played = play_virtually(k_end_s, nullptr, is_ended, &rig, &*room,
                                         {*perception, *session, *output, {&feeder}, feeds->get()});
    ASSERT_TRUE(played) << played.message();
    ASSERT_EQ(perception->percepts().feeds.size(), 1U);
    EXPECT_EQ(perception->percepts().feeds[0].state, tracker::FeedState::registered)
        << perception->percepts().feeds[0].advice;
    ASSERT_TRUE(output->close(&*session, false));
  }
  EXPECT_GT(feeder.compared, 2);
  EXPECT_EQ(feeder.lost, 0);
  EXPECT_GT(feeder.shown, 10);
  EXPECT_LT(feeder.worst_mm, 3);
  EXPECT_LT(feeder.worst_rad, 1_deg);
  EXPECT_NE(read_file(folder / "out/session.html").value().find("is registered to the room within"),
            std::string::npos);
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed) << replayed.message();
}

// A camera whose node detects: the recording holds what it saw, and no images.
TEST(CameraDetections, AreRecordedAndReplayedToTheLastBit) {
  const fs::path folder = test::test_folder();
  sim::World world = studio_world(0.6);
  SessionSetup setup;
  setup.rig = world.rig;
  setup.scene = *world.scene;
  sim::VirtualRig rig(std::move(world), virtual_rig_options(1 / 15.0));
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  const auto watched = camera_detector_setup(setup.scene, setup.watch.full_scan_every);
  ASSERT_TRUE(watched) << watched.message();
  tracker::CameraDetector detector(*watched, setup.rig.cameras[0].lens,
                                   tracker::encoding_of(setup.rig, setup.rig.cameras[0]), 3);
  {
    auto output = SessionOutput::open(folder / "out", folder / "recording", &setup);
    ASSERT_TRUE(output) << output.message();
    auto perception = Perception::create(setup.scene, setup.rig, setup.watch);
    auto session = Session::create(setup, &output->telemetry(), output->recorder(), false);
    ASSERT_TRUE(perception && session);
    for (std::size_t i = 1; i <= 8; ++i) {
      const int camera = 0;
      const Frame frame = rig.expose(std::span(&camera, 1))[0];
      const FeedInput input{.detections = {detector.detect(frame)}};
      output->recorder()->record_frames({}, input);
      session->update_percepts(perception->watch({}, input), i);
      session->compose_and_record(frame.captured_at, shifted(frame.captured_at, 0.05));
    }
    EXPECT_FALSE(session->composed().posed.parts.empty());
    ASSERT_TRUE(output->close(&*session, false));
  }
  const fs::path events = folder / "recording/events.jsonl";
  std::string text = read_file(events).value();
  EXPECT_EQ(text.find("frames/"), std::string::npos);
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed) << replayed.message();

  // Other corners give other poses.
  const std::string key = "\"corners_px\":[[";
  for (std::size_t at = text.find(key); at != std::string::npos; at = text.find(key, at + 1))
    text.insert(at + key.size(), "1");
  ASSERT_TRUE(write_file(events, text).ok());
  EXPECT_FALSE(apps::run_replay(replay));
}

// ---- the file ----

Result<std::vector<FeedConfig>> feeds_of(const json& trackers) {
  const fs::path file = test::test_folder() / "trackers.json";
  write_json(file, {{"schema", "limn.trackers/1"}, {"trackers", trackers}});
  scene::Scene scene = *studio_world().scene;
  scene.viewers.resize(1);
  scene.viewers[0].fixed.reset();
  scene.viewers[0].is_tracked = true;
  return load_feeds(file, scene);
}

TEST(Trackers, TheFileSaysWhoSendsWhatAndWhere) {
  const auto feeds = feeds_of({{{"name", "stage"},
                                {"protocol", "osc"},
                                {"receive", "127.0.0.1:7000"},
                                {"from", "127.0.0.1"},
                                {"unit", "m"},
                                {"quaternion", "xyzw"},
                                {"left_handed", true},
                                {"delay_ms", 30},
                                {"bodies", {{"wand", "mirror"}, {"hat", {{"body", "viewer"}}}}}}});
  ASSERT_TRUE(feeds) << feeds.message();
  const FeedConfig& feed = (*feeds)[0];
  EXPECT_EQ(feed.setup.name, "stage");
  EXPECT_EQ(feed.receive.port, "7000");
  EXPECT_EQ(feed.decoder.osc.unit_m, 1);
  EXPECT_TRUE(feed.decoder.osc.has_real_part_last && feed.decoder.is_left_handed);
  EXPECT_NEAR(feed.setup.delay_s, 0.03, 1e-12);
  ASSERT_EQ(feed.setup.bodies.size(), 2U);
  const auto& hat = feed.setup.bodies[feed.setup.bodies[0].sensor == "hat" ? 0 : 1];
  EXPECT_EQ(hat.body, scene::viewer_body(0));
  EXPECT_TRUE(hat.needs_position_only);
}

TEST(Trackers, TheExampleIsRead) {
  const auto feeds =
      load_feeds(fs::path(LIMN_SOURCE_DIR) / "config/trackers/stage.json", *studio_world().scene);
  ASSERT_TRUE(feeds) << feeds.message();
  EXPECT_EQ(feeds->size(), 2U);
}

TEST(Trackers, WrongFilesAreRefusedWithTheKey) {
  const json good = {
      {"name", "a"}, {"protocol", "json"}, {"receive", 7000}, {"bodies", {{"wand", "mirror"}}}};
  EXPECT_TRUE(feeds_of(json::array({good})));
  const auto refusal = [&](const std::string& key, const json& value) {
    json other = good;
    other[key] = value;
    const auto feeds = feeds_of(json::array({other}));
    return feeds ? "read" : feeds.message();
  };
  EXPECT_NE(refusal("protocol", "vrpn").find("trackers[0].protocol"), std::string::npos);
  EXPECT_NE(refusal("receive", "99999").find("trackers[0].receive"), std::string::npos);
  EXPECT_NE(refusal("from", "lab").find("numeric address"), std::string::npos);
  EXPECT_NE(refusal("bodies", {{"wand", "door"}}).find("prototype"), std::string::npos);
  EXPECT_NE(refusal("bodies", json::object()).find("found none"), std::string::npos);
  EXPECT_NE(refusal("bodies", {{"a", "mirror"}, {"b", "mirror"}}).find("twice"), std::string::npos);
  EXPECT_NE(refusal("unit", "m").find("osc only"), std::string::npos);
  EXPECT_NE(refusal("delay_ms", -1).find("0 to 1000"), std::string::npos);
  EXPECT_NE(refusal("world_from_feed", 1).find("world_from_feed"), std::string::npos);
  EXPECT_NE(refusal("port", 1).find("port"), std::string::npos);
  EXPECT_NE(feeds_of(json::array({good, good})).message().find("another name"), std::string::npos);
}

// Glasses without a marker: another system states where they are, without a rotation.
TEST(Trackers, ATrackedViewerIsWhereTheOtherSystemSees) {
  scene::Scene scene = *studio_world().scene;
  scene.viewers.resize(1);
  scene.viewers[0].fixed.reset();
  scene.viewers[0].is_tracked = true;
  PerceptionOptions options;
  const Pose world_from_feed(exp_rotation({0, 0, M_PI / 2}), {1, 0, 0});
  options.feeds = {{"lab", {{"hat", scene::viewer_body(0), std::nullopt, true}}, world_from_feed}};
  auto perception = Perception::create(scene, studio_world().rig, options);
  ASSERT_TRUE(perception) << perception.message();
  ForeignPose hat{"hat", Pose(Eigen::Quaterniond::Identity(), {0.5, 0.2, 1.7})};
  hat.has_rotation = false;
  const Percepts& percepts = perception->watch({}, {{{{hat, shifted({}, 2)}}}, {}});
  EXPECT_EQ(percepts.captured_at, shifted({}, 2));
  ASSERT_EQ(percepts.tracks.size(), 1U);
  const scene::PosedScene posed = scene::posed(scene, percepts.tracks);
  ASSERT_EQ(posed.viewpoints.size(), 1U);
  EXPECT_LT((posed.viewpoints[0].p_world - Eigen::Vector3d(0.8, 0.5, 1.7)).norm(), 1e-6);
  ASSERT_EQ(percepts.feed_notes.size(), 1U);
  EXPECT_NE(percepts.feed_notes[0].find("lab: (viewer 0) is registered"), std::string::npos)
      << percepts.feed_notes[0];
  // A slot needs the rotation, too: it is not shown by a position alone.
  options.feeds[0].bodies = {{"hat", "mirror", std::nullopt}};
  auto other = Perception::create(scene, studio_world().rig, options);
  EXPECT_TRUE(other->watch({}, {{{{hat, shifted({}, 2)}}}, {}}).tracks.empty());
  EXPECT_NE(other->percepts().feeds[0].advice.find("positions only"), std::string::npos);
}

// ---- sockets ----

TEST(Trackers, AFloodAndForeignBytesAreRefusedInWords) {
  FeedConfig config;
  config.setup = {"stage", {{"wand", "mirror", std::nullopt}}, std::nullopt};
  config.decoder.sensors = {"wand"};
  config.receive = {"127.0.0.1", "0"};
  auto feeds = PoseFeeds::open({config});
  ASSERT_TRUE(feeds) << feeds.message();
  auto socket = device::UdpSocket::sending({"127.0.0.1", std::to_string((*feeds)->port(0))});
  const auto send = [&](const std::string& text) {
    socket->send({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  };
  send("nonsense");
  send(
      R"({"poses": [{"name": "wand", "position_m": [1, 2, 3]}, {"name": "other", "position_m": [1, 2, 3]}]})");
  FeedInput input = (*feeds)->received(shifted({}, 1), true);
  ASSERT_EQ(input.poses.size(), 1U);
  ASSERT_EQ(input.poses[0].size(), 1U);
  EXPECT_NEAR(seconds_of(input.poses[0][0].arrived_at), 1, 0.5);
  EXPECT_LE(seconds_of(input.poses[0][0].arrived_at), 1);
  ASSERT_EQ(input.notes.size(), 1U);
  EXPECT_NE(input.notes[0].find("tracker stage: JSON poses: expected JSON"), std::string::npos);
  for (int i = 0; i < 100; ++i) send(R"({"poses": [{"name": "wand", "position_m": [1, 2, 3]}]})");
  input = (*feeds)->received(shifted({}, 3), true);
  EXPECT_LE(input.poses[0].size(), static_cast<std::size_t>(PoseFeeds::k_most_at_once));
  EXPECT_GE(input.poses[0].size(), 1U);
}

TEST(Trackers, OnlyTheNamedSenderIsAccepted) {
  FeedConfig config;
  config.setup = {"stage", {{"wand", "mirror", std::nullopt}}, std::nullopt};
  config.decoder.sensors = {"wand"};
  config.receive = {"127.0.0.1", "0"};
  config.from = "127.0.0.9";
  auto feeds = PoseFeeds::open({config});
  ASSERT_TRUE(feeds) << feeds.message();
  auto socket = device::UdpSocket::sending({"127.0.0.1", std::to_string((*feeds)->port(0))});
  const std::string text = R"({"poses": [{"name": "wand", "position_m": [1, 2, 3]}]})";
  socket->send({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  const FeedInput input = (*feeds)->received(shifted({}, 1), true);
  EXPECT_TRUE(input.is_empty());
  ASSERT_EQ(input.notes.size(), 1U);
  EXPECT_NE(input.notes[0].find("127.0.0.9"), std::string::npos);
}

// Bodies with balls are known to other programs as those with markers are.
TEST(Trackers, BodiesWithBallsAreReceivedAndSent) {
  const auto scene = scene::load_scene(fs::path(LIMN_SOURCE_DIR) / "config/scenes/balls");
  ASSERT_TRUE(scene) << scene.message();
  const fs::path file = test::test_folder() / "trackers.json";
  write_json(file, {{"schema", "limn.trackers/1"},
                    {"trackers", json::array({{{"name", "stage"},
                                               {"protocol", "json"},
                                               {"receive", 9010},
                                               {"bodies", {{"wand", "badge"}, {"frame", "prototype"}}}}})}});
  const auto feeds = load_feeds(file, *scene);
  ASSERT_TRUE(feeds) << feeds.message();
  EXPECT_EQ((*feeds)[0].setup.bodies.size(), 2U);
  ComposedFrame composed;
  Track track;
  track.body = "badge";
  track.world_from_body = Pose(exp_rotation({0.3, 0.2, -0.4}), {0.1, -0.2, 0.3});
  composed.tracks = {track};
  const std::vector<ForeignPose> poses = sent_poses(*scene, composed);
  const auto badge = std::ranges::find(poses, "badge", &ForeignPose::sensor);
  ASSERT_NE(badge, poses.end());
  EXPECT_FALSE(badge->is_lost);
  EXPECT_TRUE(test::pose_near(badge->feed_from_sensor, track.world_from_body, 1e-6_deg, 1e-9));
}

// What a session puts on the network, read from it.
TEST(Trackers, ASessionSendsPosesAtEachFrame) {
  auto socket = device::UdpSocket::receiving({"127.0.0.1", "0"});
  ASSERT_TRUE(socket) << socket.message();
  apps::LiveOptions options;
  options.resolution = 0.25;
  options.seconds = 0.2;
  options.poses_out = {fmt::format("json:127.0.0.1:{}", socket->port())};
  const Status lived = apps::run_live(options);
  ASSERT_TRUE(lived.ok()) << lived.message();
  std::vector<std::uint8_t> bytes(65536);
  int datagrams = 0;
  std::vector<ForeignPose> last;
  while (const auto datagram = socket->next(bytes)) {
    const auto poses = exchange::poses_of_json(
        std::string_view(reinterpret_cast<const char*>(bytes.data()), datagram->length));
    ASSERT_TRUE(poses) << poses.message();
    last = *poses;
    ++datagrams;
  }
  EXPECT_GE(datagrams, 5);
  const auto prototype = std::ranges::find(last, "prototype", &ForeignPose::sensor);
  ASSERT_NE(prototype, last.end());
  EXPECT_FALSE(prototype->is_lost);
}

// What is sent out in each form comes in again as the same poses.
TEST(Trackers, PosesThatAreSentComeInAgain) {
  scene::Scene scene = *studio_world().scene;
  ComposedFrame composed;
  composed.shown_at = shifted({}, 5);
  Track track;
  track.body = "mirror";
  track.world_from_body = Pose(exp_rotation({0.3, 0.2, -0.4}), {0.1, -0.2, 0.3});
  composed.tracks = {track};
  composed.viewer = viewer_imager(Pose(exp_rotation({-M_PI / 2, 0, 0}), {0, -2, 1}), 640, 480, 40);
  const std::vector<ForeignPose> poses = sent_poses(scene, composed);
  ASSERT_EQ(poses.size(), scene::bodies(scene).size() + 1);
  EXPECT_TRUE(poses[0].is_lost);  // the prototype has no track
  // The viewer looks along y with z up, as a studio camera at pan and tilt 0.
  EXPECT_EQ(poses.back().sensor, "viewer");
  EXPECT_TRUE(test::pose_near(poses.back().feed_from_sensor, Pose(Eigen::Quaterniond::Identity(), {0, -2, 1}),
                              1e-6_deg, 1e-9));
  for (const ForeignPose& pose : poses) {
    if (pose.is_lost) continue;
    exchange::PoseDecoder freed({.protocol = exchange::PoseProtocol::freed, .osc = {}, .sensors = {"3"}});
    const auto back = freed.decoded(*exchange::free_d_message(3, pose.feed_from_sensor));
    ASSERT_TRUE(back) << back.message();
    EXPECT_TRUE(test::pose_near((*back)[0].feed_from_sensor, pose.feed_from_sensor, 0.01_deg, 0.02_mm));
  }
  const auto json = exchange::poses_of_json(exchange::json_of_poses("Limn", poses));
  ASSERT_TRUE(json) << json.message();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ((*json)[i].is_lost, poses[i].is_lost);
    if (poses[i].is_lost) continue;
    EXPECT_TRUE(test::pose_near((*json)[i].feed_from_sensor, poses[i].feed_from_sensor, 1e-6_deg, 1e-9));
  }
  EXPECT_FALSE(PoseSender::open({"osc:127.0.0.1:9000"}));
  EXPECT_NE(PoseSender::open({"vrpn:127.0.0.1:9000"}).message().find("--poses-out"), std::string::npos);
  EXPECT_TRUE(PoseSender::open({"psn:236.10.10.10:56565", "json:127.0.0.1:9000"}));
}

}  // namespace
}  // namespace limn::session
