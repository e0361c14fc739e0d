#include "nodes/node.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/core.hpp>
#include <sstream>
#include <thread>

#include "core/image_io.h"
#include "core/version.h"
#include "device/gl_context.h"
#include "device/offscreen_display.h"
#include "nodes/file_listing.h"
#include "nodes/node_devices.h"
#include "nodes/node_frames.h"
#include "nodes/remote_devices.h"
#include "nodes/room_host.h"
#include "session/camera_threads.h"
#include "session/device_health.h"
#include "session/frame_composer.h"
#include "session/session.h"
#include "session/session_output.h"
#include "sim/virtual_rig.h"
#include "tests/nodes/memory_room.h"
#include "tests/support/matchers.h"
#include "tests/support/worlds.h"

namespace limn::nodes {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

// Files "travel" by their path on this machine, which stands in place of their hash.
class PathOffer final : public FileOffer {
 public:
  Result<std::vector<SharedFile>> share(const fs::path& folder) override {
    LIMN_TRY(std::vector<SharedFile> files, list_files(folder));
    for (SharedFile& file : files) file.sha256 = (folder / file.path).string();
    return files;
  }
};

std::atomic<int> fetched_files = 0;

Status copy_files(const Setup& setup, const Offer&, const fs::path& folder) {
  for (const SharedFile& file : setup.files) {
    fs::create_directories((folder / file.path).parent_path());
    fs::copy_file(file.sha256, folder / file.path, fs::copy_options::overwrite_existing);
    ++fetched_files;
  }
  return {};
}

// A node on a thread of its own.
class RunningNode {
 public:
  RunningNode(test::MemoryRoom* room, const std::string& name, const fs::path& folder)
      : room_(std::make_unique<test::MemoryLink>(room, name)), thread_([this, folder] {
          const NodeOptions options{
              .fetch = copy_files, .work = folder / "work", .out = folder, .offers_cameras = false};
          status_ = run_node(options, &room_, nullptr, is_ended_);
        }) {}
  ~RunningNode() {
    is_ended_ = true;
    thread_.join();
    EXPECT_TRUE(status_.ok()) << (status_ ? "" : status_.message());
  }

 private:
  std::atomic<bool> is_ended_ = false;
  Status status_;
  Room room_;
  std::thread thread_;
};

template <class Condition>
bool holds_within(std::chrono::milliseconds limit, const Condition& condition) {
  for (const auto begun = std::chrono::steady_clock::now();
       std::chrono::steady_clock::now() - begun < limit;) {
    if (condition()) return true;
    std::this_thread::sleep_for(5ms);
  }
  return condition();
}

device::DisplayConfig offscreen(const std::string& name, const std::string& host, cv::Size size) {
  device::DisplayConfig config{.name = name, .host = host, .kind = device::DisplayKind::offscreen};
  config.size = size;
  return config;
}

// The host of a session in the studio; its second projector is plugged into the node `left`.
class NodeTest : public ::testing::Test {
 protected:
  NodeTest()
      : folder_(test::test_folder()),
        world_(test::studio_world(0.25)),
        rig_(world_, {.frame_period_s = 0.05, .grab_waits_for_light = false}) {
    setup_.rig = world_.rig;
    setup_.scene = *world_.scene;
  }

  void open_host(const std::vector<device::CameraConfig>& cameras = {}) {
    const Imager& projector = setup_.rig.projectors[1];
    device::Devices devices;
    devices.displays = {
        offscreen(projector.name, "left", {projector.width, projector.height}),
        // It cannot be opened, because nodes of tests have no desktop.
        {.name = "screen0", .host = "left", .kind = device::DisplayKind::window, .size = {64, 36}}};
    devices.cameras = cameras;
    host_ = std::make_unique<Room>(std::make_unique<test::MemoryLink>(&room_, "host"));
    client_ = RoomHost::open(host_.get(), &files_, devices, folder_ / "host", AppendLog(), &setup_).value();
    ASSERT_TRUE(host_->offer({.is_host = true, .version = std::string(version())}).ok());
    context_ = device::GlContext::create().value();
    perception_ = session::Perception::create(setup_.scene, setup_.rig).value();
    composer_ = session::FrameComposer::create(setup_.scene, setup_.rig).value();
  }
  Frame exposed() {
    const int first = 0;
    return rig_.expose(std::span(&first, 1))[0];
  }
  // A camera of the node "left" that shows this image for 900 frames.
  device::CameraConfig film_of(const Frame& image) {
    fs::create_directories(folder_ / "images");
    EXPECT_TRUE(write_png(folder_ / "image.png", image.image).ok());
    for (int i = 0; i < 900; ++i)
      fs::create_symlink(folder_ / "image.png", folder_ / fmt::format("images/{:03}.png", i));
    device::CameraConfig config{.name = "camera0", .host = "left", .source = (folder_ / "images").string()};
    config.size = image.image.size();
    return config;
  }
  // Composes and sends a frame; returns the fingerprint of the node's image.
  std::uint64_t send_frame() {
    const int camera = 0;
    const session::Percepts& percepts = perception_->watch(rig_.expose(std::span(&camera, 1)));
    const session::FrameTimes times{rig_.now(), shifted(rig_.now(), 0.02)};
    const auto input = session::frame_input(setup_.scene, {}, percepts, show_state(), times);
    session::FrameDescription frame = composer_->describe(input);
    frame.shown_at =
        shifted(now(), light_after_s_);  // nodes have this machine's clock, not the virtual rig's
    client_->note_description(frame);
    const std::array<cv::Mat, 2> eyes = {composer_->draw().projectors[1], cv::Mat()};
    return session::fingerprint(eyes);
  }
  const scene::ShowState& show_state() {
    if (show_state_.slots.empty()) show_state_ = scene::initial_show_state(setup_.scene);
    return show_state_;
  }
  // Whether the node says in time that its screen shows no images.
  bool reports_the_screen() {
    const auto screen =
        RoomOpener(host_.get(), nullptr, {"screen0"})
            .display(
                {.name = "screen0", .host = "left", .kind = device::DisplayKind::window, .size = {64, 36}});
    return screen && holds_within(5s, [&] {
             const auto shown_at = (*screen)->show(cv::Mat(36, 64, CV_8UC3, cv::Scalar::all(50)));
             return !shown_at && shown_at.message().starts_with("left: screen0: expected a desktop");
           });
  }
  std::uint64_t shown_by(const std::string& node) const {
    const auto machine = host_->find(node);
    return machine && machine->health ? machine->health->shown : 0;
  }

  test::MemoryRoom room_;
  fs::path folder_;
  sim::World world_;
  sim::VirtualRig rig_;
  session::SessionSetup setup_;
  PathOffer files_;
  std::unique_ptr<Room> host_;
  std::unique_ptr<RoomHost> client_;
  std::optional<device::GlContext> context_;
  std::optional<session::Perception> perception_;
  std::optional<session::FrameComposer> composer_;
  scene::ShowState show_state_;
  double light_after_s_ = 0.02;
};

// Fingerprints by frame, from shown.csv.
std::map<std::string, std::string> shown_in(const fs::path& folder) {
  std::map<std::string, std::string> out;
  std::ifstream file(folder / "shown.csv");
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line + "\n", k_shown_log_header);
  while (std::getline(file, line)) out[line.substr(0, line.find(','))] = line.substr(line.rfind(',') + 1);
  return out;
}

TEST_F(NodeTest, ShowsTheHostsImagesAndIsBackAfterARestart) {
  open_host();
  std::map<std::string, std::string> wanted;
  const auto send = [&] {
    const std::uint64_t hash = send_frame();
    wanted[std::to_string(wanted.size() + 1)] = fmt::format("{:016x}", hash);
  };
  for (const char* run : {"first", "second"}) {
    const std::uint64_t before = wanted.size();
    {
      RunningNode node(&room_, "left", folder_ / run);
      ASSERT_TRUE(holds_within(20s, [&] {
        send();
        return shown_by("left") > before;
      }));
      EXPECT_TRUE(reports_the_screen());
      for (int i = 0; i < 10; ++i) {
        rig_.move("prototype",
                  Pose(rig_.world().world_from_prototype.rotation,
                       rig_.world().world_from_prototype.translation + Eigen::Vector3d(1e-3 * i, 0, 0)));
        send();
        if (i == 5) {  // an order between two frames
          const auto screen =
              RoomOpener(host_.get(), nullptr).display(offscreen("screen0", "left", {64, 48}));
          ASSERT_TRUE(screen) << screen.message();
          EXPECT_TRUE((*screen)->show(cv::Mat(48, 64, CV_8UC3, cv::Scalar(10, 20, 30))));
        }
        std::this_thread::sleep_for(100ms);
      }
    }
    EXPECT_TRUE(holds_within(1s, [&] { return !host_->find("left"); }));
    const auto shown = shown_in(folder_ / run);
    EXPECT_GT(shown.size(), 5u);
    for (const auto& [frame, hash] : shown) EXPECT_EQ(hash, wanted.at(frame)) << "frame " << frame;
  }
}

TEST_F(NodeTest, FramesArePlannedForTheRefreshOfANodesDisplay) {
  open_host();
  const Stamp refreshed_at = now(), expected = shifted(refreshed_at, 0.207);
  EXPECT_EQ(client_->light_at(expected), expected);
  test::MemoryLink left(&room_, "left"), stranger(&room_, "stranger");
  for (test::MemoryLink* link : {&left, &stranger}) ASSERT_TRUE(link->send(Offer{}));
  Health health;
  health.refreshes = {{shifted(refreshed_at, 0.005), 0.02}};
  ASSERT_TRUE(stranger.send(health));  // none of the session's displays are there
  health.refreshes = {{refreshed_at, 0.02}};
  ASSERT_TRUE(left.send(health));
  ASSERT_TRUE(holds_within(5s, [&] {
    const auto machine = host_->find("left");
    return machine && machine->health;
  }));
  EXPECT_NEAR(seconds_between(refreshed_at, client_->light_at(expected)), 0.22, 1e-6);
}

TEST(OtherHost, IsWaitedForUntilANodeSaysThatItHasNone) {
  test::MemoryRoom room;
  Room host(std::make_unique<test::MemoryLink>(&room, "host"));
  test::MemoryLink node(&room, "left");
  ASSERT_TRUE(node.send(Offer{}));
  const auto waited_s = [&] {
    const Stamp begun = now();
    EXPECT_TRUE(check_no_other_host(host, 1));
    return seconds_between(begun, now());
  };
  ASSERT_TRUE(node.send(Health{}));
  EXPECT_GE(waited_s(), 1);
  Health health;
  health.has_no_host = true;
  ASSERT_TRUE(node.send(health));
  EXPECT_LT(waited_s(), 0.6);
  test::MemoryLink other(&room, "other");
  ASSERT_TRUE(other.send(Offer{.is_host = true}));
  ASSERT_TRUE(holds_within(5s, [&] { return host.host().has_value(); }));
  const Status checked = check_no_other_host(host, 1);
  ASSERT_FALSE(checked);
  EXPECT_NE(checked.message().find("expected no host in it, found other"), std::string::npos);
}

// What the last line of shown.csv has in a column.
std::string last_shown(const fs::path& folder, std::size_t column) {
  std::ifstream file(folder / "shown.csv");
  std::string line, last;
  while (std::getline(file, line)) last = line;
  std::istringstream fields(last);
  for (std::size_t i = 0; i <= column; ++i) std::getline(fields, line, ',');
  return line;
}

// A deviation from the CAD of 0.8 mm everywhere.
std::shared_ptr<const scene::DeviationLayer> proud(const scene::Mesh& mesh) {
  scene::DeviationLayer layer;
  layer.number = 1;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) layer.triangles.push_back({3 * i, 1});
  layer.values.assign(3 * mesh.triangles.size(), scene::deviation_value(0.8e-3, 0.02e-3));
  layer.band_colours.fill(Eigen::Vector3f(0.2f, 0.7f, 0.1f));
  return std::make_shared<const scene::DeviationLayer>(std::move(layer));
}

TEST_F(NodeTest, ADeviationComesWhileFramesGoOn) {
  open_host();
  auto output = session::SessionOutput::open({}, {}, &setup_);
  ASSERT_TRUE(output) << output.message();
  auto session = session::Session::create(setup_, &output->telemetry(), nullptr, false);
  ASSERT_TRUE(session) << session.message();
  const session::DeviceHealth health;
  std::map<std::string, std::string> wanted;
  const auto send = [&] {
    client_->publish_state({*session, output->telemetry(), health, now()});
    const std::uint64_t hash = send_frame();
    wanted[std::to_string(wanted.size() + 1)] = fmt::format("{:016x}", hash);
    std::this_thread::sleep_for(40ms);
  };
  constexpr int k_frames = 25;
  std::size_t first = 0;
  {
    RunningNode node(&room_, "left", folder_);
    ASSERT_TRUE(holds_within(20s, [&] {
      send();
      return shown_by("left") > 0;
    }));
    first = wanted.size();
    fetched_files = 0;
    const auto layer = proud(setup_.scene.prototype->mesh);
    session->show_deviation(layer);
    show_state_.deviation.layer = layer;
    show_state_.deviation.is_shown = true;
    for (int i = 0; i < k_frames; ++i) send();
  }
  EXPECT_EQ(fetched_files, 1) << "of the whole setup, only the deviation is new";
  const auto shown = shown_in(folder_);
  int of_layer = 0, frames = 0;
  for (const auto& [frame, hash] : shown) {
    if (std::stoul(frame) <= first) continue;
    ++frames;
    of_layer += hash == wanted.at(frame);
  }
  EXPECT_GT(frames, 2 * k_frames / 3) << "the node shows frames all the time";
  EXPECT_GT(of_layer, k_frames / 2) << "with the deviation, as the host draws them";
}

TEST_F(NodeTest, ABlackFrameWaitsForNothing) {
  open_host();
  std::string black;
  std::int64_t sent_ns = 0;
  {
    RunningNode node(&room_, "left", folder_);
    ASSERT_TRUE(holds_within(20s, [&] {
      send_frame();
      return shown_by("left") > 0;
    }));
    light_after_s_ = 0.24;
    send_frame();
    std::this_thread::sleep_for(60ms);
    show_state_.blackout = true;
    sent_ns = now().time_since_epoch().count();
    black = fmt::format("{:016x}", send_frame());
    std::this_thread::sleep_for(300ms);
  }
  EXPECT_EQ(last_shown(folder_, 4), black);
  EXPECT_LT(1e-9 * static_cast<double>(std::stoll(last_shown(folder_, 3)) - sent_ns), 0.12);
}

// The node sends what its camera shows; the host's poses are those of the same images searched here.
TEST_F(NodeTest, DetectsBesideItsCamera) {
  const Frame image = exposed();
  const device::CameraConfig config = film_of(image);
  open_host({config});
  RoomOpener opener(host_.get(), nullptr);
  auto camera = opener.camera(config);
  ASSERT_TRUE(camera) << camera.message();
  RunningNode node(&room_, "left", folder_ / "node");
  const auto health = std::make_shared<session::DeviceHealth>();
  session::CameraThreads threads(health);
  threads.add(std::move(*camera), health->add({"camera0", "camera"}));
  const Stamp begun = now();

  session::Perception here = session::Perception::create(setup_.scene, setup_.rig).value();
  Frame same = image;
  std::size_t detections = 0, images = 0;
  while (detections < 30 || images < 2) {
    ASSERT_LT(seconds_between(begun, now()), 30) << detections << " detections, " << images << " images";
    const auto output = threads.take_output(50ms);
    if (!output) continue;
    EXPECT_TRUE(output->frames.empty());
    for (const auto& [name, got] : output->images) {
      EXPECT_LT(cv::norm(got.image, image.image, cv::NORM_L1) / static_cast<double>(image.image.total()), 6);
      ++images;
    }
    for (const auto& [name, found] : output->detections) {
      ++detections;
      EXPECT_LT(seconds_between(found.captured_at, now()), 1);
      perception_->watch({}, {.detections = {found}});
      same.captured_at = found.captured_at;
      here.watch(std::span(&same, 1));
    }
  }
  EXPECT_LT(images, detections / 2);  // at most five a second
  const std::vector<Track>&there = perception_->percepts().tracks, &wanted = here.percepts().tracks;
  ASSERT_EQ(there.size(), wanted.size());
  ASSERT_FALSE(wanted.empty());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_EQ(there[i].body, wanted[i].body);
    EXPECT_LT((there[i].world_from_body.translation - wanted[i].world_from_body.translation).norm(), 1e-4);
    EXPECT_LT(angle_between(there[i].world_from_body.rotation, wanted[i].world_from_body.rotation), 1e-3);
  }
}

// The node draws the session of the host before, and must detect for the new one.
TEST_F(NodeTest, DetectsForAHostThatWasRestarted) {
  const device::CameraConfig config = film_of(exposed());
  RunningNode node(&room_, "left", folder_ / "node");
  for (int run = 0; run < 2; ++run) {
    open_host({config});
    EXPECT_TRUE(holds_within(20s,
                             [&] {
                               const auto got = host_->take_detections("left", "camera0", 50ms);
                               return got && got->setup == host_->sent_setup() &&
                                      !got->found.detections.empty();
                             }))
        << "run " << run;
    client_.reset();
    host_.reset();
  }
}

TEST_F(NodeTest, ShowsAndGrabsForACalibration) {
  const cv::Mat image(48, 64, CV_8UC3, cv::Scalar(10, 20, 30));
  fs::create_directories(folder_ / "images");
  for (const char* name : {"0.png", "1.png"}) ASSERT_TRUE(write_png(folder_ / "images" / name, image).ok());
  RunningNode node(&room_, "left", folder_ / "node");
  Room host(std::make_unique<test::MemoryLink>(&room_, "host"));
  ASSERT_TRUE(host.offer({.is_host = true, .version = std::string(version())}).ok());
  ASSERT_TRUE(holds_within(5s, [&] { return host.find("left").has_value(); }));
  RoomOpener opener(&host, nullptr);

  const auto display = opener.display(offscreen("projector0", "left", {64, 48}));
  ASSERT_TRUE(display) << display.message();
  const Stamp before = now();
  const Result<Stamp> shown_at = (*display)->show(image);
  ASSERT_TRUE(shown_at) << shown_at.message();
  EXPECT_NEAR(seconds_between(before, *shown_at), 0.5, 0.5);

  device::CameraConfig config{.name = "camera0", .host = "left"};
  config.source = (folder_ / "images").string();
  const auto camera = opener.camera(config);
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ((*camera)->size(), cv::Size(64, 48));
  const Result<Frame> frame = (*camera)->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(cv::norm(frame->image, image, cv::NORM_INF), 0);

  const auto missing = opener.camera({.name = "camera1", .host = "right", .source = "v4l2:/dev/video0"});
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.message().find("camera1: expected the machine right"), std::string::npos)
      << missing.message();
  const auto no_camera = opener.camera({.name = "camera1", .host = "left", .source = "nothing"});
  ASSERT_FALSE(no_camera);
  EXPECT_NE(no_camera.message().find("left"), std::string::npos) << no_camera.message();
}

TEST(NodeDisplays, AreAllBlackWhenTheHostHasGone) {
  NodeDisplays displays(nullptr);
  std::vector<const device::OffscreenDisplay*> shown;
  for (const char* name : {"projector0", "projector1"}) {
    device::Display* display = displays.display(offscreen(name, "left", {64, 48})).value();
    ASSERT_TRUE(display->show(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(200))));
    shown.push_back(dynamic_cast<const device::OffscreenDisplay*>(display));
  }
  displays.darken();
  for (const device::OffscreenDisplay* display : shown)
    EXPECT_EQ(cv::countNonZero(display->image().reshape(1)), 0);
}

}  // namespace
}  // namespace limn::nodes
