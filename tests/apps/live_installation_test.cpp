// The program on monitors and with a camera: ended by a signal, and kept running by systemd with the unit
// that is installed (tests/device/on_xorg.sh, on_systemd.sh). Pixels are read from the X server.
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cstdlib>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <thread>
#include <vector>

#include "core/file.h"
#include "core/rig.h"
#include "sim/virtual_rig.h"
#include "tests/device/mjpeg_answer.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"
#include "tests/support/worlds.h"

// Included last, because it defines macros such as None and Status.
#include <X11/Xlib.h>
#include <X11/Xutil.h>
#include <X11/extensions/Xcomposite.h>
#undef Status
#undef None
#undef Success

extern char** environ;

namespace limn {
namespace {

namespace fs = std::filesystem;
using test::expect_contains;

const cv::Size k_size(384, 240);  // of a projector
constexpr const char* k_mode = "384x240 10 384 400 420 440 240 243 246 260";
constexpr unsigned long k_wallpaper = 0x0000c0;  // a bright blue

struct Ended {
  int code = -1;  // exit code; -1: ended by a signal
  std::string out;
};

// Runs a line of the shell; `out` has both of its outputs.
Ended run(const std::string& line) {
  FILE* const pipe = popen(("{ " + line + "; } 2>&1").c_str(), "r");
  Ended ended;
  for (int letter = std::fgetc(pipe); letter != EOF; letter = std::fgetc(pipe))
    ended.out.push_back(static_cast<char>(letter));
  const int status = pclose(pipe);
  if (WIFEXITED(status)) ended.code = WEXITSTATUS(status);
  while (ended.out.ends_with('\n')) ended.out.pop_back();
  return ended;
}

// Whether it becomes true within that time.
bool within(double limit_s, const std::function<bool()>& is_true) {
  const Stamp until = shifted(now(), limit_s);
  while (!is_true()) {
    if (now() >= until) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

cv::Mat pixels_of(::Display* server, Drawable drawable, cv::Rect part) {
  XImage* x_image = XGetImage(server, drawable, part.x, part.y, static_cast<unsigned>(part.width),
                              static_cast<unsigned>(part.height), AllPlanes, ZPixmap);
  cv::Mat image(part.size(), CV_8UC3);
  for (int y = 0; x_image && y < part.height; ++y)
    for (int x = 0; x < part.width; ++x) {
      const unsigned long pixel = XGetPixel(x_image, x, y);
      image.at<cv::Vec3b>(y, x) = {static_cast<uchar>(pixel), static_cast<uchar>(pixel >> 8),
                                   static_cast<uchar>(pixel >> 16)};
    }
  EXPECT_TRUE(x_image);
  if (x_image) XDestroyImage(x_image);
  return image;
}

// Two projectors side by side on an X server, a camera on the network, and the files of an installation.
class Installation : public testing::Test {
 protected:
  Installation()
      : world_(test::studio_world(0.3)),
        jpeg_(seen_in(world_)),
        camera_([this](test::LoopbackClient& client) { serve_camera(client); }) {}

  void SetUp() override {
    if (!std::getenv("LIMN_TEST_MONITORS")) GTEST_SKIP() << "no monitors: Installation";
    for (const char* output : {"DUMMY0", "DUMMY1"})  // the mode may be there from the test before
      run(fmt::format("xrandr --newmode {0}-{1}; xrandr --addmode {0} {0}-384x240", output, k_mode));
    const Ended placed = run(
        "xrandr --output DUMMY0 --mode DUMMY0-384x240 --pos 0x0 --output DUMMY1 --mode DUMMY1-384x240 --pos "
        "384x0 && xrandr --query");
    ASSERT_EQ(placed.code, 0) << placed.out;
    server_ = XOpenDisplay(nullptr);
    ASSERT_TRUE(server_);
  }
  void TearDown() override {
    if (process_ > 0) end(SIGKILL);
    if (server_) XCloseDisplay(server_);
  }

  // Writes the files into the folder in which the service looks for them.
  void write_files(const fs::path& folder) const {
    fs::create_directories(folder);
    ASSERT_TRUE(save_rig(world_.rig, folder / "rig"));
    fs::copy(test::config_folder() / "scenes/door", folder / "scene");
    ASSERT_TRUE(write_file(folder / "devices.json", fmt::format(R"({{"schema": "limn.devices/1",
          "cameras": [{{"name": "camera0", "source": "http://127.0.0.1:{}/"}}],
          "displays": [{{"name": "projector0", "monitor": "DUMMY0"}},
                       {{"name": "projector1", "monitor": "DUMMY1"}},
                       {{"name": "wall", "monitor": "DUMMY9"}}]}})",
                                                                camera_.port())));
  }

  static std::string live_in(const fs::path& folder) {
    return fmt::format("live --devices {0}/devices.json --rig {0}/rig --scene {0}/scene", folder.string());
  }

  void start(const fs::path& folder) {
    std::string line = "exec " LIMN_PROGRAM " " + live_in(folder) + " 2>" + (folder / "log").string();
    std::vector<std::string> words = {"sh", "-c", line};
    char* const arguments[] = {words[0].data(), words[1].data(), words[2].data(), nullptr};
    ASSERT_EQ(posix_spawn(&process_, "/bin/sh", nullptr, nullptr, arguments, environ), 0);
  }
  int end(int signal) {
    kill(process_, signal);
    int status = 0;
    waitpid(process_, &status, 0);
    process_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  static cv::Rect place_of(int projector) { return {{projector * k_size.width, 0}, k_size}; }
  cv::Mat shown_at(int projector) const {
    return pixels_of(server_, DefaultRootWindow(server_), place_of(projector));
  }
  // Whether both projectors show light, and not the desktop.
  bool is_lit() const {
    for (const int projector : {0, 1}) {
      cv::Mat red;
      cv::extractChannel(shown_at(projector), red, 2);
      if (cv::norm(red, cv::NORM_INF) < 50) return false;
    }
    return true;
  }
  bool is_black() const {
    return cv::norm(shown_at(0), cv::NORM_INF) == 0 && cv::norm(shown_at(1), cv::NORM_INF) == 0;
  }

  // The windows that fill a projector.
  std::vector<Window> windows() const {
    Window root = 0, parent = 0, *children = nullptr;
    unsigned count = 0;
    XQueryTree(server_, DefaultRootWindow(server_), &root, &parent, &children, &count);
    std::vector<Window> found;
    for (unsigned i = 0; i < count; ++i) {
      XWindowAttributes is{};
      XGetWindowAttributes(server_, children[i], &is);
      if (is.map_state == IsViewable && cv::Size(is.width, is.height) == k_size) found.push_back(children[i]);
    }
    XFree(children);
    return found;
  }

  void paint_desktop(unsigned long colour) const {
    XSetWindowBackground(server_, DefaultRootWindow(server_), colour);
    XClearWindow(server_, DefaultRootWindow(server_));
    XSync(server_, False);
  }

  ::Display* server_ = nullptr;

 private:
  static std::vector<uchar> seen_in(const sim::World& world) {
    sim::VirtualRig room(world, {.grab_waits_for_light = false});
    std::vector<uchar> jpeg;
    cv::imencode(".jpg", room.camera(0).next()->image, jpeg);
    return jpeg;
  }
  void serve_camera(test::LoopbackClient& client) const {
    client.receive_until("\r\n\r\n");
    bool is_there = client.send(test::k_mjpeg_answer);
    while (is_there) {
      is_there = client.send(test::mjpeg_part({jpeg_.begin(), jpeg_.end()}));
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }

  sim::World world_;
  std::vector<uchar> jpeg_;
  test::LoopbackServer camera_;
  pid_t process_ = -1;
};

// A window's pixmap stays when the window is closed: it has the last image.
TEST_F(Installation, ShowsBlackLastWhenItIsEnded) {
  const fs::path folder = test::test_folder();
  write_files(folder);
  paint_desktop(k_wallpaper);
  XCompositeRedirectSubwindows(server_, DefaultRootWindow(server_), CompositeRedirectAutomatic);
  start(folder);
  ASSERT_TRUE(within(30, [&] { return is_lit(); })) << read_file(folder / "log").value();
  std::vector<Pixmap> kept;
  for (const Window window : windows()) kept.push_back(XCompositeNameWindowPixmap(server_, window));
  XSync(server_, False);
  ASSERT_EQ(kept.size(), 2u);
  for (const Pixmap pixmap : kept)
    EXPECT_GT(cv::norm(pixels_of(server_, pixmap, {{}, k_size}), cv::NORM_INF), 50);
  EXPECT_EQ(end(SIGTERM), 0);
  for (const Pixmap pixmap : kept)
    EXPECT_EQ(cv::norm(pixels_of(server_, pixmap, {{}, k_size}), cv::NORM_INF), 0);
  EXPECT_EQ(windows().size(), 0u);
}

// Libraries of EGL's callers end the process without it.
TEST_F(Installation, SaysThatEglIsMissing) {
  const fs::path folder = test::test_folder();
  write_files(folder);
  fs::create_directories(folder / "libraries");
  ASSERT_TRUE(write_file(folder / "libraries/libEGL.so.1", "no library"));
  const std::string without = "LD_LIBRARY_PATH=" + (folder / "libraries").string() + " " LIMN_PROGRAM " ";
  for (const std::string& command : {live_in(folder), std::string("doctor --show 0.1")}) {
    const Ended ended = run(without + command);
    EXPECT_EQ(ended.code, 1);
    expect_contains(ended.out, "OpenGL: expected the library libEGL.so.1, found none. Install ");
  }
}

class Service : public Installation {
 protected:
  void SetUp() override {
    if (!std::getenv("LIMN_TEST_SYSTEMD")) GTEST_SKIP() << "no systemd: Service";
    Installation::SetUp();
    if (HasFatalFailure()) return;
    const fs::path own = std::getenv("XDG_CONFIG_HOME");
    fs::remove_all(own);
    live_ = own / "limn/live";
    write_files(live_);
    std::string unit = read_file(LIMN_SOURCE_DIR "/tools/install/limn-live.service.in").value();
    const std::string program = "@program@";
    unit.replace(unit.find(program), program.size(), LIMN_PROGRAM);
    fs::create_directories(own / "systemd/user");
    ASSERT_TRUE(write_file(own / "systemd/user/limn-live.service", unit));
    ASSERT_EQ(run("systemctl --user daemon-reload && systemctl --user import-environment DISPLAY").code, 0);
  }
  void TearDown() override {
    run("systemctl --user kill --signal KILL limn-live; systemctl --user stop limn-live");
    Installation::TearDown();
  }

  static std::string property(const std::string& name) {
    return run("systemctl --user show --value -p " + name + " limn-live").out;
  }
  static pid_t process() { return std::atoi(property("MainPID").c_str()); }
  // By the program's name: the journal asks the process for its unit, which may have ended by then.
  static std::string journal(const std::string& options) {
    return run("journalctl --no-pager -o cat -t limn " + options).out;
  }
  // The seconds until it is ready again as another process.
  static double restarted_s(pid_t before) {
    const Stamp begun = now();
    EXPECT_TRUE(within(30, [&] { return process() != before && property("ActiveState") == "active"; }));
    return seconds_between(begun, now());
  }

  fs::path live_;
};

TEST_F(Service, IsKeptRunningBySystemdAndEndsBlack) {
  paint_desktop(0);  // as the kiosk's recipe in docs/setting-up.md
  const Ended started = run("systemctl --user start limn-live");
  ASSERT_EQ(started.code, 0) << started.out << journal("");
  EXPECT_TRUE(within(30, [&] { return is_lit(); })) << journal("");
  expect_contains(property("StatusText"), "frame");

  const pid_t hung = process();
  ASSERT_GT(hung, 1);
  kill(hung, SIGSTOP);
  EXPECT_GT(restarted_s(hung), 4) << "before WatchdogSec=10 had passed since the last sign of life";
  EXPECT_EQ(property("NRestarts"), "1");
  EXPECT_TRUE(within(30, [&] { return is_lit(); }));

  const pid_t killed = process();
  ASSERT_GT(killed, 1);
  const Stamp killed_at = now();
  kill(killed, SIGKILL);
  ASSERT_TRUE(within(30, [&] { return !is_lit(); }));
  ASSERT_TRUE(within(30, [&] { return is_lit(); })) << journal("");
  fmt::print("light again {:.1f} s after kill -9\n", seconds_between(killed_at, now()));
  restarted_s(killed);
  EXPECT_EQ(property("NRestarts"), "2");

  const Ended second = run(LIMN_PROGRAM " " + live_in(live_));
  EXPECT_EQ(second.code, 1);
  expect_contains(second.out,
                  "expected to use it alone, found that process " + property("MainPID") + " uses it");

  EXPECT_EQ(run("systemctl --user stop limn-live").code, 0);
  EXPECT_EQ(property("ActiveState") + " " + property("Result"), "inactive success");
  EXPECT_TRUE(is_black());

  const std::string warning = "expected the monitor DUMMY9";
  EXPECT_TRUE(within(30, [] { return journal("").find("pictures: ") != std::string::npos; })) << journal("");
  expect_contains(journal("-p warning"), warning);
  EXPECT_EQ(journal("-p warning").find("pictures: "), std::string::npos);
  EXPECT_EQ(journal("-p err").find(warning), std::string::npos);
}

TEST_F(Service, IsNotTriedAgainWithAWrongOption) {
  ASSERT_TRUE(write_file(live_ / "../live.env", "LIMN_LIVE_OPTIONS=--prediction never\n"));
  EXPECT_NE(run("systemctl --user start limn-live").code, 0);
  EXPECT_EQ(property("ActiveState") + " " + property("ExecMainStatus"), "failed 2");
  EXPECT_TRUE(within(30, [] { return journal("-p err").find("--prediction: ") != std::string::npos; }))
      << journal("");
}

}  // namespace
}  // namespace limn
