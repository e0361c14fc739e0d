// Tests of full-screen displays on a virtual screen (one monitor) and on Xorg's dummy driver (several
// monitors, on_xorg.sh). The shown pixels are read back from the X server, not from the drawn image.

#include "device/monitor_display.h"

#include <epoxy/gl.h>

#include <chrono>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <thread>

#include "device/gl_context.h"
#include "device/open_display.h"
#include "device/window.h"
#include "tests/support/display.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

// Included last, because it defines macros such as None and Status.
#include <X11/Xlib.h>
#include <X11/Xutil.h>
#undef Status
#undef None
#undef Success

namespace limn::device {
namespace {

using Clock = std::chrono::steady_clock;
using test::expect_contains;

// Quarters in red, green, blue and grey, with a white pixel in the top left and the bottom right corner.
cv::Mat quarters(cv::Size size, int grey) {
  cv::Mat image(size, CV_8UC3, cv::Scalar::all(grey));
  const int w = size.width / 2, h = size.height / 2;
  image(cv::Rect(0, 0, w, h)).setTo(cv::Scalar(0, 0, 255));
  image(cv::Rect(w, 0, w, h)).setTo(cv::Scalar(0, 255, 0));
  image(cv::Rect(0, h, w, h)).setTo(cv::Scalar(255, 0, 0));
  image.at<cv::Vec3b>(0, 0) = {255, 255, 255};
  image.at<cv::Vec3b>(size.height - 1, size.width - 1) = {255, 255, 255};
  return image;
}

// The pixels that the X server shows at this position.
cv::Mat lit(cv::Point position, cv::Size size) {
  ::Display* server = XOpenDisplay(nullptr);
  XImage* x_image =
      XGetImage(server, DefaultRootWindow(server), position.x, position.y, static_cast<unsigned>(size.width),
                static_cast<unsigned>(size.height), AllPlanes, ZPixmap);
  cv::Mat image(size, CV_8UC3);
  for (int y = 0; x_image && y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const unsigned long pixel = XGetPixel(x_image, x, y);
      image.at<cv::Vec3b>(y, x) = {static_cast<uchar>(pixel), static_cast<uchar>(pixel >> 8),
                                   static_cast<uchar>(pixel >> 16)};
    }
  if (x_image) XDestroyImage(x_image);
  XCloseDisplay(server);
  return image;
}

// Shows the image until the X server has it, because a swap reaches the server with a delay.
testing::AssertionResult shows(MonitorDisplay* display, const cv::Mat& image, cv::Point position) {
  cv::Mat found;
  for (int i = 0; i < 50; ++i) {
    const auto shown = display->show(image);
    if (!shown) return testing::AssertionFailure() << shown.message();
    found = lit(position, image.size());
    if (cv::norm(found, image, cv::NORM_INF) == 0) return testing::AssertionSuccess();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return test::image_near(found, image, 0, 0, display->name());
}

class OnADesktop : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::has_x_server()) GTEST_SKIP() << "no display: MonitorDisplay";
    auto opened = Desktop::open();
    ASSERT_TRUE(opened) << opened.message();
    desktop_.emplace(*opened);
    ASSERT_FALSE(desktop_->monitors().empty());
    first_ = desktop_->monitors()[0];
  }
  std::optional<Desktop> desktop_;
  Monitor first_;
};

using AMonitor = OnADesktop;

TEST_F(AMonitor, IsListedAndADesktopIsTheOnlyOne) {
  EXPECT_FALSE(first_.name.empty());
  EXPECT_GE(first_.largest.area(), first_.size.area());
  EXPECT_EQ(desktop_->find(first_.name)->size, first_.size);
  EXPECT_FALSE(desktop_->find("nowhere"));
  const auto second = Desktop::open();
  ASSERT_FALSE(second);
  expect_contains(second.message(), "Pass that one on");
  EXPECT_FALSE(Window::open("Limn", 32, 32));
  desktop_.reset();
  const auto again = Desktop::open();
  EXPECT_TRUE(again) << again.message();
}

TEST_F(AMonitor, IsLitPixelForPixel) {
  const auto context = GlContext::create();
  ASSERT_TRUE(context) << context.message();
  auto window = Window::open(
      *desktop_, {.title = "beside", .width = 64, .height = 48});  // another open window must not matter
  ASSERT_TRUE(window) << window.message();
  auto display =
      MonitorDisplay::open(*desktop_, {.name = "left", .monitor = first_.name, .size = first_.size});
  ASSERT_TRUE(display) << display.message();
  EXPECT_EQ(display->name(), "left");
  EXPECT_EQ(display->size(), first_.size);
  EXPECT_TRUE(shows(&*display, quarters(first_.size, 90), first_.position));
  EXPECT_TRUE(shows(&*display, quarters(first_.size, 30), first_.position));
  cv::Mat grey;
  cv::extractChannel(quarters(first_.size, 60), grey, 1);
  cv::Mat expected;
  cv::merge(std::vector<cv::Mat>{grey, grey, grey}, expected);
  ASSERT_TRUE(display->show(grey));
  EXPECT_TRUE(shows(&*display, expected, first_.position));
  GLuint texture = 0;  // the context without a window is current again
  glCreateTextures(GL_TEXTURE_2D, 1, &texture);
  EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
  glDeleteTextures(1, &texture);
}

TEST_F(AMonitor, LightLeavesAfterTheSwapByTheLatency) {
  auto display = MonitorDisplay::open(*desktop_, {.monitor = first_.name, .latency_s = 0.4});
  ASSERT_TRUE(display) << display.message();
  const Stamp begun = Clock::now();
  const auto shown_at = display->show(quarters(first_.size, 90));
  ASSERT_TRUE(shown_at);
  EXPECT_GE(seconds_between(begun, *shown_at), 0.4);
  EXPECT_LE(seconds_between(Clock::now(), *shown_at), 0.4);
}

TEST_F(AMonitor, AndAWindowAreOpenedByName) {
  auto display = open_display({.name = "left", .monitor = first_.name}, &*desktop_);
  ASSERT_TRUE(display) << display.message();
  EXPECT_EQ((*display)->size(), first_.size);
  auto window =
      open_display({.name = "screen", .kind = DisplayKind::window, .size = {1920, 1080}}, &*desktop_);
  ASSERT_TRUE(window) << window.message();
  EXPECT_EQ((*window)->size(), cv::Size(1920, 1080));
  EXPECT_TRUE((*window)->show(quarters({1920, 1080}, 50)));
  EXPECT_FALSE((*window)->show(quarters({1920, 1000}, 50)));
  EXPECT_FALSE(open_display({.kind = DisplayKind::window}, &*desktop_));
}

// The virtual screens of the tests have no framebuffers for two eyes. The message says what to do, and the
// context without a window is current again.
TEST_F(AMonitor, WithoutFramebuffersForTwoEyesIsRefused) {
  for (const DisplayKind kind : {DisplayKind::monitor, DisplayKind::window}) {
    const auto display = open_display({.name = "wall",
                                       .kind = kind,
                                       .monitor = kind == DisplayKind::monitor ? first_.name : "",
                                       .size = first_.size,
                                       .stereo = StereoLayout::quad_buffer},
                                      &*desktop_);
    if (display) GTEST_SKIP() << "this display has framebuffers for two eyes";
    expect_contains(display.message(), "wall: expected OpenGL with a framebuffer for each eye");
    expect_contains(display.message(), "side_by_side");
    GLuint texture = 0;
    glCreateTextures(GL_TEXTURE_2D, 1, &texture);
    EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
    glDeleteTextures(1, &texture);
  }
  auto ordinary = MonitorDisplay::open(*desktop_, {.monitor = first_.name});
  ASSERT_TRUE(ordinary) << ordinary.message();
  EXPECT_TRUE(ordinary->show(quarters(first_.size, 90)));
}

TEST_F(AMonitor, OfAnotherNameOrSizeIsRefused) {
  const auto unknown = MonitorDisplay::open(*desktop_, {.name = "left", .monitor = "HDMI-9"});
  ASSERT_FALSE(unknown);
  expect_contains(unknown.message(), "left: expected the monitor HDMI-9, found " + first_.name);
  const auto other = MonitorDisplay::open(*desktop_, {.monitor = first_.name, .size = {1111, 999}});
  ASSERT_FALSE(other);
  expect_contains(other.message(),
                  fmt::format("mode 1111x999, found it in {}x{}", first_.size.width, first_.size.height));
  auto display = MonitorDisplay::open(*desktop_, {.monitor = first_.name});
  ASSERT_TRUE(display) << display.message();
  const auto small = display->show(cv::Mat(20, 30, CV_8UC3, cv::Scalar()));
  ASSERT_FALSE(small);
  expect_contains(small.message(), "found 30x20");
  EXPECT_FALSE(display->show(cv::Mat(first_.size, CV_16UC1, cv::Scalar())));
}

// The query makes the dummy driver detect which monitors are plugged in.
void xrandr(const std::string& arguments) {
  ASSERT_EQ(std::system(fmt::format("xrandr {} && xrandr --query >/dev/null", arguments).c_str()), 0)
      << arguments;
}

class SeveralMonitors : public OnADesktop {
 protected:
  void SetUp() override {
    if (!std::getenv("LIMN_TEST_MONITORS")) GTEST_SKIP() << "one monitor at most: SeveralMonitors";
    xrandr("--output DUMMY0 --mode 1280x800 --pos 0x0");
    for (const char* name : {"DUMMY1", "DUMMY2"}) xrandr(fmt::format("--addmode {} 1024x768", name));
    xrandr("--addmode DUMMY1 800x600");
    xrandr("--output DUMMY1 --mode 1024x768 --pos 1280x0 --output DUMMY2 --mode 1024x768 --pos 2304x100");
    OnADesktop::SetUp();
  }
  MonitorDisplay opened(const std::string& monitor, cv::Size size) {
    return MonitorDisplay::open(*desktop_, {.name = "on " + monitor, .monitor = monitor, .size = size})
        .value();
  }
};

TEST_F(SeveralMonitors, EachShowsItsOwnImage) {
  const auto monitors = desktop_->monitors();
  ASSERT_EQ(monitors.size(), 3u);
  EXPECT_EQ(monitors[1].name, "DUMMY1");
  EXPECT_EQ(monitors[1].position, cv::Point(1280, 0));
  auto a = opened("DUMMY0", {1280, 800}), b = opened("DUMMY1", {1024, 768}),
       c = opened("DUMMY2", {1024, 768});
  EXPECT_TRUE(shows(&a, quarters({1280, 800}, 50), {0, 0}));
  EXPECT_TRUE(shows(&b, quarters({1024, 768}, 100), {1280, 0}));
  EXPECT_TRUE(shows(&c, quarters({1024, 768}, 150), {2304, 100}));
  EXPECT_TRUE(shows(&a, quarters({1280, 800}, 55), {0, 0}));
  EXPECT_TRUE(test::image_near(lit({1280, 0}, {1024, 768}), quarters({1024, 768}, 100), 0, 0, "undisturbed"));
}

TEST_F(SeveralMonitors, StayInTheirMode) {
  xrandr("--output DUMMY0 --mode 1024x768 --rate 60 --pos 0x0");  // the mode also exists at 75 and 85 Hz
  auto display = opened("DUMMY0", {1024, 768});
  EXPECT_TRUE(shows(&display, quarters({1024, 768}, 100), {0, 0}));
  EXPECT_EQ(desktop_->find("DUMMY0")->refresh_hz, 60);
}

TEST_F(SeveralMonitors, AnUnpluggedOneIsNamedShowsNowhereAndComesBack) {
  auto a = opened("DUMMY0", {1280, 800}), b = opened("DUMMY1", {1024, 768});
  const cv::Mat left = quarters({1280, 800}, 50), right = quarters({1024, 768}, 100);
  EXPECT_TRUE(shows(&a, left, {0, 0}));
  EXPECT_TRUE(shows(&b, right, {1280, 0}));
  xrandr("--output DUMMY1 --off");
  auto gone = b.show(right);
  for (int i = 0; gone && i < 100; ++i) {  // until the X server reports it
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    gone = b.show(right);
  }
  ASSERT_FALSE(gone);
  expect_contains(gone.message(),
                  "on DUMMY1: expected the monitor DUMMY1, found DUMMY0 (1280x800) DUMMY2 (1024x768)");
  EXPECT_TRUE(shows(&a, left, {0, 0}));
  xrandr("--output DUMMY1 --mode 1024x768 --pos 0x800");  // plugged in at another position
  auto back = b.show(right);
  for (int i = 0; !back && i < 100; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    back = b.show(right);
  }
  ASSERT_TRUE(back) << back.message();
  EXPECT_TRUE(shows(&b, right, {0, 800}));
  EXPECT_TRUE(shows(&a, left, {0, 0}));
}

TEST_F(SeveralMonitors, AnotherModeIsRefusedUntilTheRigsIsBack) {
  auto b = opened("DUMMY1", {1024, 768});
  const cv::Mat right = quarters({1024, 768}, 100);
  EXPECT_TRUE(shows(&b, right, {1280, 0}));
  xrandr("--output DUMMY1 --mode 800x600 --pos 1280x0");
  auto other = b.show(right);
  for (int i = 0; other && i < 100; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    other = b.show(right);
  }
  ASSERT_FALSE(other);
  expect_contains(other.message(), "in the rig's mode 1024x768, found it in 800x600");
  EXPECT_GT(desktop_->find("DUMMY1")->largest.area(), 800 * 600);
  xrandr("--output DUMMY1 --mode 1024x768 --pos 1280x0");
  auto back = b.show(right);
  for (int i = 0; !back && i < 100; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    back = b.show(right);
  }
  ASSERT_TRUE(back) << back.message();
  EXPECT_TRUE(shows(&b, right, {1280, 0}));
}

}  // namespace
}  // namespace limn::device
