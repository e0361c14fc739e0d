#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <thread>

#include "apps/replay.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/latest.h"
#include "device/gl_context.h"
#include "device/image_sequence_camera.h"
#include "device/jpeg.h"
#include "device/source_clock.h"
#include "remote/server.h"
#include "session/camera_threads.h"
#include "session/device_session.h"
#include "session/live_recalibration.h"
#include "sim/virtual_rig.h"
#include "tests/remote/remote_client.h"
#include "tests/support/canvas.h"
#include "tests/support/clicker.h"
#include "tests/support/matchers.h"
#include "tests/support/small_disk.h"
#include "tests/support/worlds.h"

namespace limn::remote {
namespace {

namespace fs = std::filesystem;
using namespace test::literals;
using test::Canvas;

// A camera that sends JPEG, whose cable is out for a while.
class LooseCamera : public device::CameraSource {
 public:
  LooseCamera(device::ImageSequenceCamera camera, int from, int until)
      : camera_(std::move(camera)), from_(from), until_(until) {}
  const std::string& name() const override { return camera_.name(); }
  cv::Size size() const override { return camera_.size(); }
  int asked() const { return asked_; }
  Result<Frame> next() override {
    const int asked = ++asked_;
    if (asked >= from_ && asked < until_) return error("camera0: the cable is out.");
    LIMN_TRY(const Frame taken, camera_.next());
    const std::vector<std::uint8_t> jpeg = device::encode_jpeg(taken.image, 85);
    LIMN_TRY(Frame frame, device::decode_frame({jpeg.begin(), jpeg.end()}));
    frame.camera = taken.camera;
    frame.captured_at = taken.captured_at;
    return frame;
  }

 private:
  device::ImageSequenceCamera camera_;
  int from_, until_;
  std::atomic<int> asked_ = 0;
};

TEST(Latest, TheNewestWinsAndNothingQueues) {
  Latest<int> box;
  EXPECT_FALSE(box.take_newest(std::chrono::milliseconds(1)));
  std::thread writer([&] {
    for (int i = 1; i <= 1000; ++i) box.put(i);
  });
  writer.join();
  EXPECT_EQ(box.take_newest(std::chrono::milliseconds(1)), 1000);
  EXPECT_FALSE(box.take_newest(std::chrono::milliseconds(1)));
  box.put(3);
  box.put(4, [](const int& old, int& next) { next += old; });
  EXPECT_EQ(box.take_newest(std::chrono::milliseconds(1)), 7);
}

TEST(SourceClock, StampsComeOntoTheSessionsClockAlsoWhenTheirClockSteps) {
  const Stamp begun = shifted(Stamp{}, 5000);
  device::SourceClock own;  // the session's clock, 30 ms on the way
  for (int i = 0; i < 5; ++i) {
    const Stamp now = shifted(begun, 0.1 * i);
    const auto time = own.on_session_clock(shifted(now, -0.03), now);
    EXPECT_NEAR(seconds_between(time.captured_at, now), 0.03, 1e-9);
    EXPECT_FALSE(time.has_stepped);
  }
  EXPECT_FALSE(own.is_other());
  for (const double step_s : {3600.0, -7200.0, 20.0}) {
    const auto time = own.on_session_clock(shifted(begun, 1 + step_s), shifted(begun, 1));
    EXPECT_TRUE(time.has_stepped);
    EXPECT_NEAR(seconds_between(time.captured_at, shifted(begun, 1)), 0.03, 1e-6) << "as late as before";
    const auto next = own.on_session_clock(shifted(begun, 1.1 + step_s), shifted(begun, 1.1));
    EXPECT_FALSE(next.has_stepped);
    EXPECT_NEAR(seconds_between(next.captured_at, shifted(begun, 1.1)), 0.03, 1e-6);
  }
  device::SourceClock video;
  EXPECT_EQ(video.on_session_clock(Stamp{}, begun).captured_at, begun);
  EXPECT_TRUE(video.is_other());
}

// A camera whose driver searches for it and does not come back.
class StuckCamera : public device::CameraSource {
 public:
  explicit StuckCamera(std::shared_future<void> freed) : freed_(std::move(freed)) {}
  const std::string& name() const override { return name_; }
  cv::Size size() const override { return {64, 48}; }
  Result<Frame> next() override {
    freed_.wait();
    return error("camera0: it is gone.");
  }

 private:
  std::string name_ = "camera0";
  std::shared_future<void> freed_;
};

TEST(CameraThreads, ACameraThatDoesNotComeBackIsLeft) {
  std::promise<void> freed;
  auto health = std::make_shared<session::DeviceHealth>();
  const std::size_t number = health->add({"camera0", "camera"});
  auto threads = std::make_unique<session::CameraThreads>(health);
  threads->add(std::make_unique<StuckCamera>(freed.get_future().share()), number);
  EXPECT_FALSE(threads->take_output(std::chrono::milliseconds(10)).has_value());
  const auto begun = std::chrono::steady_clock::now();
  testing::internal::CaptureStderr();
  threads.reset();
  EXPECT_NE(testing::internal::GetCapturedStderr().find("camera0 does not respond"), std::string::npos);
  EXPECT_LT(seconds_between(begun, std::chrono::steady_clock::now()), 1.5);
  freed.set_value();
  for (int i = 0; i < 500 && health.use_count() > 1; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(health.use_count(), 1) << "its thread has ended and taken everything with it";
}

TEST(Recorder, AFullDiskLeavesNoHalfRecording) {
  const fs::path folder = test::test_folder();
  const sim::World world = test::studio_world();
  session::SessionSetup setup;
  setup.rig = world.rig;
  setup.scene = *world.scene;
  {
    const test::SmallDisk disk(3000);
    EXPECT_FALSE(session::Recorder::create(folder / "recording", setup));
  }
  EXPECT_TRUE(fs::is_empty(folder / "recording"));
  EXPECT_TRUE(session::Recorder::create(folder / "recording", setup));
}

// Brightness by JPEG itself is not what its colours make of it.
TEST(Recorder, AFrameIsReadAsItWasWatched) {
  const fs::path folder = test::test_folder();
  const sim::World world = test::studio_world();
  session::SessionSetup setup;
  setup.rig = world.rig;
  setup.scene = *world.scene;
  cv::Mat colours(48, 64, CV_8UC3);
  cv::randu(colours, 0, 256);
  const std::vector<std::uint8_t> jpeg = device::encode_jpeg(colours, 90);
  Frame sent = device::decode_frame({jpeg.begin(), jpeg.end()}).value();
  sent.camera = "camera0";
  const Frame taken{"camera0", colours, {}};
  auto recorder = session::Recorder::create(folder / "recording", setup).value();
  recorder->record_frames(std::vector{sent, taken});
  ASSERT_TRUE(recorder->finish().ok());
  const auto first = session::load_frame(folder / "recording/frames/camera0/000000.jpg");
  ASSERT_TRUE(first) << first.message();
  EXPECT_TRUE(test::image_near(first->image, sent.image, 0, 0, "image"));
  EXPECT_TRUE(test::image_near(first->grey, sent.grey, 0, 0, "brightness"));
  EXPECT_GT(cv::norm(first->grey, to_grey(sent.image), cv::NORM_INF), 0);
  const auto second = session::load_frame(folder / "recording/frames/camera0/000001.png");
  ASSERT_TRUE(second) << second.message();
  EXPECT_TRUE(test::image_near(second->image, colours, 0, 0, "picture"));
  EXPECT_FALSE(session::load_frame(folder / "recording/frames/camera0/000002.jpg"));
}

// Threads as of a real rig, on stored images of the studio at their pace; a recording of it replays as the
// threads ran.
TEST(LiveDevices, PlaysAndRecords) {
  const fs::path folder = test::test_folder();
  sim::World world = test::studio_world(0.5);
  session::SessionSetup setup;
  setup.rig = world.rig;
  setup.scene = *world.scene;
  sim::VirtualRig room(std::move(world), {.grab_waits_for_light = false});
  ASSERT_TRUE(make_folder(folder / "pictures").ok());
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(write_png(folder / "pictures" / fmt::format("{}.png", i), room.camera(0).next()->image).ok());

  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto output = session::SessionOutput::open(folder / "out", folder / "recording", &setup);
  ASSERT_TRUE(output) << output.message();
  auto perception = session::Perception::create(setup.scene, setup.rig, setup.watch);
  ASSERT_TRUE(perception) << perception.message();
  auto session = session::Session::create(setup, &output->telemetry(), output->recorder());
  ASSERT_TRUE(session) << session.message();
  session::SessionDevices devices;
  auto loose = std::make_unique<LooseCamera>(
      device::ImageSequenceCamera::open(folder / "pictures", {.frames_per_second = 20, .repeat = true})
          .value(),
      8, 16);
  const LooseCamera& camera = *loose;
  devices.cameras.push_back(std::move(loose));
  const Imager& first = setup.rig.projectors[0];
  auto canvas = std::make_unique<Canvas>(first.name, cv::Size(first.width, first.height));
  const Canvas& projector = *canvas;
  devices.projectors.push_back(std::move(canvas));
  devices.projectors.push_back(nullptr);  // the second was not found
  auto wide = std::make_unique<Canvas>("screen", cv::Size(640, 480));
  const Canvas& screen = *wide;

  const test::Clicker clicker(folder / "clicker");
  devices.keys.push_back(device::KeySource::open({"clicker", folder / "clicker"}).value());
  clicker.send(EV_KEY, KEY_PAGEDOWN, 1);

  std::atomic<bool> is_ended = false;
  int since_back = 0;  // images since the camera is back
  wide->on_show = [&] {
    since_back += camera.asked() > 16;
    // Images are also of the time without a camera.
    is_ended = since_back > 1 && projector.most_lit > 1000 && screen.most_lit > 1000;
  };
  devices.screens.push_back(std::move(wide));
  const Status played = session::play_on_devices(&devices, 300, is_ended, {*perception, *session, *output});
  ASSERT_TRUE(played.ok()) << played.message();
  EXPECT_TRUE(is_ended) << "lit " << projector.most_lit << " and " << screen.most_lit << " bytes";
  EXPECT_EQ(cv::countNonZero(screen.shown.row(10).reshape(1)), 0);  // bars above a wider image
  ASSERT_TRUE(output->close(&*session, false).ok());
  const std::string page = read_file(folder / "out/session.html").value();
  EXPECT_NE(page.find("camera0 is gone; the session goes on without it: camera0: the cable is out"),
            std::string::npos);
  EXPECT_NE(page.find("camera0 is back"), std::string::npos);
  EXPECT_NE(page.find("next_variant mirror (clicker)"), std::string::npos);

  const std::string events = read_file(folder / "recording/events.jsonl").value();
  EXPECT_NE(events.find("frames/camera0/000000.jpg"), std::string::npos);
  EXPECT_EQ(events.find(".png"), std::string::npos);
  apps::ReplayOptions replay;
  replay.session = folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
}

TEST(LiveDevices, EndsAfterItsSeconds) {
  const fs::path folder = test::test_folder();
  const sim::World world = test::studio_world(0.1);
  session::SessionSetup setup{world.rig, *world.scene, {}, {}};
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto output = session::SessionOutput::open({}, {}, &setup);
  ASSERT_TRUE(output) << output.message();
  auto perception = session::Perception::create(setup.scene, setup.rig);
  auto session = session::Session::create(setup, &output->telemetry(), nullptr, false);
  ASSERT_TRUE(perception && session);
  const Imager& first = world.rig.cameras[0];
  ASSERT_TRUE(write_png(folder / "seen.png", cv::Mat(first.height, first.width, CV_8UC1, cv::Scalar(90))));
  session::SessionDevices devices;
  devices.cameras.push_back(std::make_unique<device::ImageSequenceCamera>(
      device::ImageSequenceCamera::open(folder / "seen.png", {.repeat = true}).value()));
  devices.projectors.push_back(std::make_unique<Canvas>(
      world.rig.projectors[0].name, cv::Size(world.rig.projectors[0].width, world.rig.projectors[0].height)));
  devices.projectors.resize(world.rig.projectors.size());
  const std::atomic<bool> is_ended = false;
  const auto begun = std::chrono::steady_clock::now();
  const Status played = session::play_on_devices(&devices, 0.5, is_ended, {*perception, *session, *output});
  EXPECT_TRUE(played.ok()) << played.message();
  const double took_s = seconds_between(begun, std::chrono::steady_clock::now());
  EXPECT_GE(took_s, 0.5);
  EXPECT_LT(took_s, 0.5 + 1 + 1.5);  // its end, and an image that was being painted on a slow machine
}

// A room of which threads have their turns; its cameras' stamps are of the session's clock.
struct SharedRoom {
  sim::VirtualRig rig;
  std::mutex mutex;
};

class RoomCamera : public device::CameraSource {
 public:
  RoomCamera(SharedRoom* room, int index) : room_(room), index_(index) {}
  const std::string& name() const override { return room_->rig.camera(index_).name(); }
  cv::Size size() const override { return room_->rig.camera(index_).size(); }
  Result<Frame> next() override {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const std::lock_guard lock(room_->mutex);
    const Stamp exposed_at = std::chrono::steady_clock::now();
    LIMN_TRY(Frame frame, room_->rig.camera(index_).next());
    frame.captured_at = exposed_at;
    return frame;
  }

 private:
  SharedRoom* room_;
  int index_;
};

class RoomProjector : public device::Display {
 public:
  RoomProjector(SharedRoom* room, int index) : room_(room), index_(index) {}
  const std::string& name() const override { return room_->rig.projector(index_).name(); }
  cv::Size size() const override { return room_->rig.projector(index_).size(); }
  Result<Stamp> show(const cv::Mat& image) override {
    if (cv::countNonZero(image.reshape(1)) > 1000) ++lit_images_;
    const std::lock_guard lock(room_->mutex);
    const Result<Stamp> shown_at = room_->rig.projector(index_).show(image);
    return shown_at ? Result<Stamp>(std::chrono::steady_clock::now()) : shown_at;
  }
  int lit_images() const { return lit_images_; }

 private:
  SharedRoom* room_;
  int index_;
  std::atomic<int> lit_images_ = 0;
};

// A session whose camera was nudged, and what is left of it after a repair while it ran.
struct Repair {
  fs::path folder;
  Rig before, after;
  Pose camera_from_world, world_from_prototype;  // true
  double repair_s = 0, longest_edit_s = 0;
  std::set<std::string> progress;  // texts that guests received
  std::string progress_at_end;
  session::ComposedFrame composed;
};

// The nudged camera is found by the session's own devices, whose threads go on with the mended rig.
void play_a_repair(Repair* repair) {
  const fs::path folder = repair->folder = test::test_folder();
  sim::World world = test::studio_world(0.5);
  session::SessionSetup setup;
  setup.rig = world.rig;
  setup.rig.provenance_json = R"({"display_latency_ms": {"projector0": 0, "projector1": 0}})";
  setup.scene = *world.scene;
  Pose& moved = world.rig.cameras[0].imager_from_world;
  moved = Pose(exp_rotation(Eigen::Vector3d(0, 0.25, 0) * M_PI / 180), Eigen::Vector3d::Zero()) * moved;
  const Pose truth = moved, world_from_prototype = world.world_from_prototype;
  SharedRoom room{sim::VirtualRig(std::move(world), {.display_delay_s = 0, .grab_waits_for_light = false}),
                  {}};
  const auto context = device::GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto output = session::SessionOutput::open(folder / "out", folder / "recording", &setup);
  ASSERT_TRUE(output) << output.message();
  auto perception = session::Perception::create(setup.scene, setup.rig, setup.watch);
  auto session = session::Session::create(setup, &output->telemetry(), output->recorder());
  ASSERT_TRUE(perception && session);
  session::SessionDevices devices;
  devices.cameras.push_back(std::make_unique<RoomCamera>(&room, 0));
  devices.projectors.push_back(std::make_unique<RoomProjector>(&room, 0));
  auto second = std::make_unique<RoomProjector>(&room, 1);
  const RoomProjector& lit = *second;
  devices.projectors.push_back(std::move(second));
  // Meanwhile guests are answered, and progress how far it is.
  ASSERT_TRUE(make_folder(folder / "page").ok());
  ASSERT_TRUE(write_file(folder / "page/index.html", "<title>Limn</title>").ok());
  const auto server = Server::open({.at = "0", .page = folder / "page", .keys = {}}, {}).value();
  ASSERT_TRUE(session->edit({"repair", "", ""}, "test", {}));
  std::atomic<bool> is_ended = false;
  double& longest_s = repair->longest_edit_s;
  std::thread guest([&] {
    const auto ask = [&](const std::string& path, const nlohmann::json& body, const std::string& token) {
      return nlohmann::json::parse(test::RemoteClient(server->port()).post(path, body.dump(), token).body);
    };
    const std::string token = ask("/api/pair", {{"pin", server->invitation().pins[2]}}, "")["token"];
    const auto begun = std::chrono::steady_clock::now();
    for (int i = 0; i < 1200 && !fs::exists(folder / "recording/rig-2"); ++i) {
      const auto requested_at = std::chrono::steady_clock::now();
      (void)ask("/api/edit", {{"action", "grid"}, {"value", i % 2 ? "on" : "off"}}, token);
      longest_s = std::max(longest_s, seconds_between(requested_at, std::chrono::steady_clock::now()));
      const std::string state = test::RemoteClient(server->port()).get("/api/state", token).body;
      repair->progress.insert(nlohmann::json::parse(state)["repair"]);
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    repair->repair_s = seconds_between(begun, std::chrono::steady_clock::now());
    // Until the mended rig has painted twice, which takes seconds on a busy machine.
    const int lit_before = lit.lit_images();
    for (int i = 0; i < 600 && lit.lit_images() < lit_before + 2; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    is_ended = true;
  });
  const Status played =
      session::play_on_devices(&devices, 300, is_ended, {*perception, *session, *output, {server.get()}});
  guest.join();
  ASSERT_TRUE(played.ok()) << played.message();
  ASSERT_TRUE(output->close(&*session, false).ok());
  repair->before = setup.rig;
  repair->after = session->setup().rig;
  repair->camera_from_world = truth;
  repair->world_from_prototype = world_from_prototype;
  repair->progress_at_end = session->recalibration().progress;
  repair->composed = session->composed();
}

class RunningRepair : public testing::Test {
 protected:
  static void SetUpTestSuite() { play_a_repair(&repair_.emplace()); }
  static void TearDownTestSuite() { repair_.reset(); }
  static inline std::optional<Repair> repair_;
};

TEST_F(RunningRepair, GuestsAreAnsweredMeanwhileAndToldHowFarItIs) {
  const double longest_s = repair_->longest_edit_s, repair_s = repair_->repair_s;
  const std::set<std::string>& progress = repair_->progress;
  std::printf("during a repair of %.1f s an edit took %.2f s at most\n", repair_s, longest_s);
  // An image that is being painted, or a painter for the mended rig; without answers meanwhile it would be
  // all of it.
  EXPECT_LT(longest_s, 0.7 * repair_s);
  EXPECT_TRUE(progress.contains("computing"));
  EXPECT_GT(std::count_if(progress.begin(), progress.end(),
                          [](const std::string& words) { return words.ends_with(" patterns"); }),
            3);
  EXPECT_EQ(repair_->progress_at_end, "");
}

TEST_F(RunningRepair, TheSessionGoesOnWithTheMendedRig) {
  EXPECT_TRUE(test::pose_near(repair_->after.cameras[0].imager_from_world, repair_->camera_from_world,
                              0.02 * M_PI / 180, 0.0015));
  const session::ComposedFrame& painted = repair_->composed;
  ASSERT_TRUE(painted.posed.world_from_prototype);
  EXPECT_TRUE(
      test::pose_near(*painted.posed.world_from_prototype, repair_->world_from_prototype, 0.2_deg, 1.5_mm));
  EXPECT_GT(cv::countNonZero(painted.projectors[1].reshape(1)), 1000);
}

TEST_F(RunningRepair, ItsRecordingReplays) {
  apps::ReplayOptions replay;
  replay.session = repair_->folder / "recording";
  const Status replayed = apps::run_replay(replay);
  EXPECT_TRUE(replayed.ok()) << replayed.message();
}

// With the images that were taken.
TEST_F(RunningRepair, WhateverItIsAtItEndsInTime) {
  for (const bool is_computing : {false, true}) {
    std::vector<fs::path> shown;
    auto repair = std::make_unique<session::LiveRecalibration>(
        repair_->before, repair_->folder / fmt::format("ended-{}", is_computing), [&](ImageWriter* writer) {
          wizard::WizardBackend backend;
          backend.capture.show = [&](int projector, const cv::Mat&) -> Status {
            const fs::path images =
                repair_->folder /
                fmt::format("out/repaired-1/captures/pose00/projector{}/camera0", projector);
            const auto before = std::count_if(shown.begin(), shown.end(), [&](const fs::path& path) {
              return path.parent_path() == images;
            });
            shown.push_back(images / fmt::format("{:03}.png", before));
            return {};
          };
          backend.capture.grab = [&](int) { return read_image(shown.back()); };
          backend.capture.store = [writer](const fs::path& path, const cv::Mat& image) {
            return writer->store(path, image);
          };
          backend.wait_for_files = [writer] { return writer->finish(); };
          backend.use_latency = [](int, double) {};
          return backend;
        });
    while (is_computing ? repair->is_capturing() : shown.size() < 10)
      repair->serve(std::chrono::milliseconds(10));
    EXPECT_FALSE(repair->take_result());
    const auto begun = std::chrono::steady_clock::now();
    repair.reset();
    const double took_s = seconds_between(begun, std::chrono::steady_clock::now());
    std::printf("a repair that was %s ended in %.2f s\n", is_computing ? "computing" : "capturing", took_s);
    EXPECT_LT(took_s, std::max(0.5, 0.2 * repair_->repair_s));  // a slow machine takes longer for both
  }
}

TEST(LiveDevices, SaysWhatIsMissing) {
  session::SessionDevices devices;
  const Status checked = session::check_devices(devices);
  ASSERT_FALSE(checked.ok());
  EXPECT_NE(checked.message().find("a camera that works"), std::string::npos);
}

}  // namespace
}  // namespace limn::remote
