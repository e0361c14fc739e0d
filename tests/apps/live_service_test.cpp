// The program as a service: the test plays the service manager.
#include "apps/live_service.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/frame.h"
#include "device/device_locks.h"
#include "device/offscreen_display.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

extern char** environ;

namespace limn {
namespace {

namespace fs = std::filesystem;

// A service manager in small: a socket for messages, and a program that it starts.
class Manager {
 public:
  explicit Manager(const fs::path& folder) : folder_(folder) {
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    address_ = "@limn-test-" + std::to_string(getpid());  // abstract: a folder's path may be too long
    sockaddr_un to{};
    to.sun_family = AF_UNIX;
    std::memcpy(to.sun_path + 1, address_.data() + 1, address_.size() - 1);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&to), size), 0);
    log_ = open((folder / "journal").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  }
  ~Manager() {
    if (process_ > 0) stop(SIGKILL);
    close(socket_);
    close(log_);
  }

  void start() {
    struct stat journal {};
    fstat(log_, &journal);
    std::vector<std::string> variables = {
        "NOTIFY_SOCKET=" + address_, "WATCHDOG_USEC=1000000",
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

  // Whether the message comes within that time.
  bool receives(const std::string& message, double limit_s) const {
    const Stamp until = shifted(now(), limit_s);
    while (now() < until) {
      pollfd ready{socket_, POLLIN, 0};
      if (poll(&ready, 1, 100) <= 0) continue;
      std::array<char, 512> text{};
      const ssize_t size = recv(socket_, text.data(), text.size(), 0);
      if (size > 0 && std::string(text.data(), static_cast<std::size_t>(size)).starts_with(message))
        return true;
    }
    return false;
  }

  // Drops the messages that have come so far.
  void forget() const {
    std::array<char, 512> text{};
    while (recv(socket_, text.data(), text.size(), MSG_DONTWAIT) > 0) {
    }
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
  std::string address_;
  int socket_ = -1, log_ = -1;
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
}

}  // namespace
}  // namespace limn
