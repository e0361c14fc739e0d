#include "device/open_display.h"

#include <chrono>
#include <opencv2/core.hpp>

#include "device/offscreen_display.h"
#include "tests/support/matchers.h"

namespace limn::device {
namespace {

using Clock = std::chrono::steady_clock;

TEST(OpenDisplay, OffscreenKeepsTheImageShown) {
  const auto display = open_display(
      {.name = "left", .kind = DisplayKind::offscreen, .size = {8, 6}, .latency_s = 0.5}, nullptr);
  ASSERT_TRUE(display) << display.message();
  EXPECT_EQ((*display)->name(), "left");
  EXPECT_EQ((*display)->size(), cv::Size(8, 6));
  cv::Mat image(6, 8, CV_8UC1, cv::Scalar(9));
  const Stamp begun = Clock::now();
  const auto shown_at = (*display)->show(image);
  ASSERT_TRUE(shown_at);
  EXPECT_GE(seconds_between(begun, *shown_at), 0.5);
  image.setTo(1);
  EXPECT_EQ(dynamic_cast<OffscreenDisplay&>(**display).image().at<std::uint8_t>(3, 3), 9);
  const auto wide = (*display)->show(cv::Mat(6, 9, CV_8UC1, cv::Scalar()));
  ASSERT_FALSE(wide);
  EXPECT_NE(wide.message().find("of 8x6, found 9x6"), std::string::npos) << wide.message();
  EXPECT_FALSE((*display)->show(cv::Mat(6, 8, CV_16UC1, cv::Scalar())));
}

TEST(OpenDisplay, WithoutADesktopOrASizeTheErrorSaysSo) {
  EXPECT_TRUE(needs_desktop({.monitor = "HDMI-1"}));
  EXPECT_TRUE(needs_desktop({.kind = DisplayKind::window}));
  EXPECT_FALSE(needs_desktop({.kind = DisplayKind::offscreen}));
  for (const DisplayConfig& config :
       {DisplayConfig{.name = "left", .monitor = "HDMI-1", .size = {8, 6}},
        DisplayConfig{.name = "left", .kind = DisplayKind::window, .size = {8, 6}}}) {
    const auto display = open_display(config, nullptr);
    ASSERT_FALSE(display);
    EXPECT_NE(display.message().find("left: expected a desktop"), std::string::npos) << display.message();
  }
  const auto sizeless = open_display({.name = "left", .kind = DisplayKind::offscreen}, nullptr);
  ASSERT_FALSE(sizeless);
  EXPECT_NE(sizeless.message().find("left: expected a size"), std::string::npos) << sizeless.message();
}

}  // namespace
}  // namespace limn::device
