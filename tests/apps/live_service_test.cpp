// The program as a service: the test plays the service manager.
#include "apps/live_service.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/frame.h"
#include "core/image_io.h"
#include "device/device_locks.h"
#include "device/gl_context.h"
#include "device/image_sequence_camera.h"
#include "device/offscreen_display.h"
#include "session/perception.h"
#include "tests/support/matchers.h"
#include "tests/support/service_manager.h"
#include "tests/support/text.h"
#include "tests/support/worlds.h"

extern char** environ;

namespace limn {
namespace {

namespace fs = std::filesystem;

// A service manager in small: a socket for messages, and a program that it starts.
class Manager : public test::NotifySocket {
 public:
  explicit Manager(const fs::path& folder) : folder_(folder) {
    log_ = open((folder / "journal").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  }
  ~Manager() {
    if (process_ > 0) stop(SIGKILL);
    close(log_);
  }

  void start() {
    struct stat journal {};
    fstat(log_, &journal);
    std::vector<std::string> variables = {
        "NOTIFY_SOCKET=" + address(), "WATCHDOG_USEC=1000000",
        "JOURNAL_STREAM=" + std::to_string(journal.st_dev) + ":" + std::to_string(journal.st_ino)};
    for (char** variable = environ; *variable; ++variable) variables.emplace_back(*variable);
    std::vector<std::string> arguments = {"limn", "live", "--resolution", "0.25", "--seconds", "600"};
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, log_, STDERR_FILENO);
    EXPECT_EQ(posix_spawn(&process_, LIMN_PROGRAM, &files, nullptr, pointers(&arguments).data(),
                          pointers(&variables).data()),
              0);
    posix_spawn_file_actions_destroy(&files);
  }

  void send(int signal) const { kill(process_, signal); }

  // Sends the signal and waits for the end. Returns the exit code, or minus the signal that ended it.
  int stop(int signal) {
    send(signal);
    int status = 0;
    waitpid(process_, &status, 0);
    process_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  std::string journal() const { return read_file(folder_ / "journal").value(); }

 private:
  static std::vector<char*> pointers(std::vector<std::string>* texts) {
    std::vector<char*> out;
    for (std::string& text : *texts) out.push_back(text.data());
    out.push_back(nullptr);
    return out;
  }

  fs::path folder_;
  int log_ = -1;
  pid_t process_ = -1;
};

TEST(LiveService, IsBackWithLightAfterItWasKilled) {
  constexpr double k_restart_s = 1;  // RestartSec of tools/install/limn-live.service.in
  constexpr double k_limit_s = 5;
  Manager manager(test::test_folder());
  manager.start();
  ASSERT_TRUE(manager.receives("READY=1", 20)) << manager.journal();
  EXPECT_TRUE(manager.receives("WATCHDOG=1", 2));

  ASSERT_EQ(manager.stop(SIGKILL), -SIGKILL);
  manager.forget();
  const Stamp killed = now();
  manager.start();
  ASSERT_TRUE(manager.receives("READY=1", 20)) << manager.journal();
  const double light_s = seconds_between(killed, now());
  RecordProperty("light_s", std::to_string(light_s));
  EXPECT_LT(light_s + k_restart_s, k_limit_s);

  EXPECT_TRUE(manager.receives("WATCHDOG=1", 2));
  manager.send(SIGSTOP);  // a loop that hangs
  usleep(100'000);
  manager.forget();
  EXPECT_FALSE(manager.receives("WATCHDOG=1", 1));
  manager.send(SIGCONT);
  EXPECT_TRUE(manager.receives("WATCHDOG=1", 2));

  EXPECT_EQ(manager.stop(SIGTERM), 0);
  EXPECT_TRUE(manager.receives("STOPPING=1", 1));
  test::expect_contains(manager.journal(), "<6>live: ");
}

// A projector that fails until its sixth image, and ends the session after its eighth. Before each image it
// reads what the manager was told.
class LateProjector final : public device::Display {
 public:
  LateProjector(const Imager& projector, const test::NotifySocket* manager, std::atomic<bool>* is_ended)
      : name_(projector.name),
        size_(projector.width, projector.height),
        manager_(manager),
        is_ended_(is_ended) {}
  const std::string& name() const override { return name_; }
  cv::Size size() const override { return size_; }
  Result<Stamp> show(const cv::Mat&) override {
    std::string message;
    while (!(message = manager_->next(0)).empty()) (shown_ > k_failures ? after_ : before_) += message + "\n";
    if (++shown_ == k_last) *is_ended_ = true;
    if (shown_ <= k_failures) return error("{}: the cable is out.", name_);
    return now();
  }
  const std::string& before() const { return before_; }
  const std::string& after() const { return after_; }

 private:
  static constexpr int k_failures = 5, k_last = 8;
  std::string name_, before_, after_;
  cv::Size size_;
  const test::NotifySocket* manager_;
  std::atomic<bool>* is_ended_;
  int shown_ = 0;
};

TEST(LiveService, IsReadyWhenAProjectorShowsAnImage) {
  const test::NotifySocket manager;
  setenv("NOTIFY_SOCKET", manager.address().c_str(), 1);
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
  const Imager& camera = world.rig.cameras[0];
  ASSERT_TRUE(write_png(folder / "seen.png", cv::Mat(camera.height, camera.width, CV_8UC1, cv::Scalar(90))));
  session::SessionDevices devices;
  devices.cameras.push_back(std::make_unique<device::ImageSequenceCamera>(
      device::ImageSequenceCamera::open(folder / "seen.png", {.repeat = true}).value()));
  devices.projectors.resize(world.rig.projectors.size());
  std::atomic<bool> is_ended = false;
  auto projector = std::make_unique<LateProjector>(world.rig.projectors[0], &manager, &is_ended);
  const LateProjector& late = *projector;
  devices.projectors[0] = std::move(projector);
  apps::LiveService service;
  session::SessionParts parts{*perception, *session, *output, {&service}};
  const Status played = session::play_on_devices(&devices, 300, is_ended, parts);
  ASSERT_TRUE(played) << played.message();
  EXPECT_EQ(late.before(), "");
  test::expect_contains(late.after(), "READY=1");
}

TEST(LiveService, EndsWithBlackOnEveryDisplay) {
  session::SessionDevices devices;
  auto projector = std::make_unique<device::OffscreenDisplay>("projector0", cv::Size(4, 3));
  const device::OffscreenDisplay& shown = *projector;
  ASSERT_TRUE(projector->show(cv::Mat(3, 4, CV_8UC3, cv::Scalar::all(200))));
  devices.projectors.push_back(nullptr);  // one that could not be opened
  devices.projectors.push_back(std::move(projector));
  apps::darken(devices);
  ASSERT_FALSE(shown.image().empty());
  EXPECT_EQ(cv::norm(shown.image(), cv::NORM_INF), 0);
}

TEST(LiveService, IsNotStartedTwiceOnTheSameDevicesOrMonitor) {
  const fs::path folder = test::test_folder();
  setenv("XDG_RUNTIME_DIR", folder.c_str(), 1);
  device::Devices one{.file = folder / "one.json"}, other{.file = folder / "other.json"};
  one.displays.push_back({.name = "projector0", .monitor = "HDMI-1"});
  other.displays.push_back({.name = "left", .monitor = "HDMI-1"});
  const auto locks = device::lock_devices(one);
  ASSERT_TRUE(locks) << locks.message();
  const auto again = device::lock_devices(one), same_monitor = device::lock_devices(other);
  ASSERT_FALSE(again);
  test::expect_contains(again.message(), "one.json: expected to use it alone, found that process");
  ASSERT_FALSE(same_monitor);
  test::expect_contains(same_monitor.message(),
                        "other.json: displays: the monitor HDMI-1: expected to use it");
  other.displays[0].monitor = "HDMI-2";
  EXPECT_TRUE(device::lock_devices(other));

  ASSERT_TRUE(write_file(folder / "file", "no folder"));
  setenv("XDG_RUNTIME_DIR", (folder / "file/runtime").c_str(), 1);
  test::expect_contains(device::lock_devices(other).message(),
                        "for the locks of devices, found: Not a directory");
}

}  // namespace
}  // namespace limn
