// Tests of GigE cameras with Aravis' fake camera, a separate program that uses GigE Vision on the loopback.

#include "device/gige_camera.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <opencv2/core.hpp>
#include <thread>

#include "device/open_camera.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

namespace limn::device {
namespace {

using Clock = std::chrono::steady_clock;
using test::expect_contains;

constexpr const char* k_id = "Aravis-Fake-LIMN7";

// The process of the fake camera. Killing it has the effect of an unplugged cable.
class FakeCamera {
 public:
  FakeCamera() {
    // All fake cameras use the same port, so tests that run at the same time take turns.
    const auto path = std::filesystem::temp_directory_path() / "limn-fake-gige-camera.lock";
    turn_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    flock(turn_, LOCK_EX);
    child_ = fork();
    if (child_ != 0) return;
    execlp("arv-fake-gv-camera-0.8", "arv-fake-gv-camera-0.8", "-i", "127.0.0.1", "-s", "LIMN7", nullptr);
    _exit(99);
  }
  ~FakeCamera() { pull_out(); }
  FakeCamera(const FakeCamera&) = delete;
  FakeCamera& operator=(const FakeCamera&) = delete;
  void pull_out() {
    if (child_ <= 0) return;
    kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
    child_ = -1;
    close(turn_);
  }

 private:
  int turn_ = -1;
  pid_t child_ = -1;
};

Result<std::unique_ptr<CameraSource>> opened(GigeCameraOptions options = {}) {
  options.limit_s = 2;
  auto camera = open_gige_camera(k_id, options);
  for (int i = 0; !camera && i < 3; ++i)
    camera = open_gige_camera(k_id, options);  // the fake camera needs time to start
  return camera;
}

TEST(GigeCamera, DeliversFramesLockedAndStamped) {
  const FakeCamera fake;
  auto camera = opened({.name = "left", .sensor = {.exposure_ms = 20, .gain = 3, .white_balance_k = 5000}});
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ((*camera)->size(), cv::Size(512, 512));
  Stamp last = Stamp{};
  for (int i = 0; i < 5; ++i) {
    const auto frame = (*camera)->next();
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_EQ(frame->camera, "left");
    EXPECT_EQ(frame->image.type(), CV_8UC3);
    EXPECT_GT(frame->captured_at, last);
    EXPECT_LT(seconds_between(frame->captured_at, Clock::now()), 0.5);
    last = frame->captured_at;
  }
  const auto settings = (*camera)->settings();
  ASSERT_EQ(settings.size(), 3u);
  EXPECT_EQ(settings[0].problem, "");
  EXPECT_NEAR(settings[0].found.value_or(0), 20, 0.1);
  EXPECT_EQ(settings[1].problem, "");
  EXPECT_NEAR(settings[1].found.value_or(0), 3, 0.1);
  expect_contains(settings[2].problem, "white_balance_k");
  // After a pause the reader gets the newest frame, not one of those that filled the buffers first.
  std::this_thread::sleep_for(std::chrono::milliseconds(1000));
  const Stamp begun = Clock::now();
  const auto frame = (*camera)->next();
  ASSERT_TRUE(frame);
  EXPECT_LT(seconds_between(frame->captured_at, begun), 0.6) << (*camera)->description();
  EXPECT_EQ((*camera)->description().find(" 0 frames skipped"), std::string::npos)
      << (*camera)->description();
}

TEST(GigeCamera, ARegionAndBrightnessAloneThroughOpenCamera) {
  const FakeCamera fake;
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  const CameraConfig wanted = {.source = fmt::format("gige:{}", k_id), .size = {320, 240}, .grey = true};
  auto camera = open_camera(wanted);
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ((*camera)->size(), cv::Size(320, 240));
  expect_contains((*camera)->description(), "Mono8 320x240");
  const auto frame = (*camera)->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(frame->image.type(), CV_8UC1);
  EXPECT_EQ(frame->image.size(), cv::Size(320, 240));
  cv::Scalar mean, deviation;
  cv::meanStdDev(frame->image, mean, deviation);
  EXPECT_GT(deviation[0], 5) << "the fake camera's pattern is not flat";
  const std::vector<std::string> ids = gige_cameras().value();
  EXPECT_NE(std::find(ids.begin(), ids.end(), k_id), ids.end());
}

TEST(GigeCamera, APulledCableIsNamedAndTheCameraComesBack) {
  FakeCamera fake;
  auto camera = opened();
  ASSERT_TRUE(camera) << camera.message();
  fake.pull_out();
  Stamp begun = Clock::now();
  Result<Frame> frame = (*camera)->next();
  for (int i = 0; frame && i < 20; ++i) {
    begun = Clock::now();
    frame = (*camera)->next();
  }
  EXPECT_LT(seconds_between(begun, Clock::now()), 4) << "the limit plus the time of a search";
  ASSERT_FALSE(frame);
  expect_contains(frame.message(), "it sends no frame");
  {
    const FakeCamera again;
    for (int i = 0; !frame && i < 15; ++i) frame = (*camera)->next();
    EXPECT_TRUE(frame) << frame.message();
    expect_contains((*camera)->description(), "opened 2 times");
  }
  begun = Clock::now();
  camera = error("left");
  EXPECT_LT(seconds_between(begun, Clock::now()), 3)
      << "the destructor ends in time although the camera is gone";
}

TEST(GigeCamera, NobodyIsNamed) {
  const Stamp begun = Clock::now();
  const auto camera = open_camera({.source = "gige:Nobody-1", .limit_s = 0.5});
  ASSERT_FALSE(camera);
  expect_contains(camera.message(), "gige:Nobody-1");
  expect_contains(camera.message(), "not found");
  EXPECT_LT(seconds_between(begun, Clock::now()), 5);
}

}  // namespace
}  // namespace limn::device
