#include "device/open_display.h"

#include <chrono>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "device/offscreen_display.h"
#include "device/stereo_display.h"
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
  EXPECT_FALSE(needs_desktop({.host = "left", .monitor = "HDMI-1"}));
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

// What an offscreen display of this layout would show to two eyes.
class ForTwoEyes : public testing::TestWithParam<StereoLayout> {
 protected:
  const DisplayConfig config_{
      .name = "left", .kind = DisplayKind::offscreen, .size = {8, 6}, .stereo = GetParam()};
  const cv::Mat dark_ = cv::Mat(6, 8, CV_8UC3, cv::Scalar::all(9));
  const cv::Mat light_ = cv::Mat(6, 8, CV_8UC3, cv::Scalar::all(90));
};

TEST_P(ForTwoEyes, TheDisplayTakesBothImages) {
  const auto display = open_display(config_, nullptr);
  ASSERT_TRUE(display) << display.message();
  EXPECT_TRUE((*display)->is_stereo());
  EXPECT_EQ((*display)->size(), cv::Size(8, 6)) << "each eye's image is whole";
  EXPECT_TRUE((*display)->show_eyes({dark_, light_}));
  EXPECT_TRUE((*display)->show(dark_));
  const auto wide = (*display)->show_eyes({dark_, cv::Mat(6, 9, CV_8UC3, cv::Scalar())});
  ASSERT_FALSE(wide);
  EXPECT_NE(wide.message().find("of 8x6, found 9x6"), std::string::npos) << wide.message();
}
INSTANTIATE_TEST_SUITE_P(Layouts,
                         ForTwoEyes,
                         testing::Values(StereoLayout::side_by_side,
                                         StereoLayout::top_bottom,
                                         StereoLayout::frame_sequential),
                         [](const auto& layout) { return k_stereo_layouts.text(layout.param); });

// Notes the images that it shows.
class Shown : public Display {
 public:
  explicit Shown(std::vector<cv::Mat>* images) : images_(images) {}
  const std::string& name() const override { return name_; }
  cv::Size size() const override { return {8, 6}; }
  Result<Stamp> show(const cv::Mat& image) override {
    images_->push_back(image.clone());
    return shifted(Stamp{}, static_cast<double>(images_->size()));
  }

 private:
  std::string name_ = "screen";
  std::vector<cv::Mat>* images_;
};

TEST(AStereoDisplay, ShowsOneImageWithBothOrTwoInTurns) {
  const cv::Mat dark(6, 8, CV_8UC3, cv::Scalar::all(9)), light(6, 8, CV_8UC3, cv::Scalar::all(90));
  std::vector<cv::Mat> images;
  StereoDisplay beside(std::make_unique<Shown>(&images), StereoLayout::side_by_side);
  ASSERT_TRUE(beside.show_eyes({dark, light}));
  ASSERT_EQ(images.size(), 1U);
  EXPECT_EQ(images[0].at<cv::Vec3b>(0, 3)[0], 9);
  EXPECT_EQ(images[0].at<cv::Vec3b>(0, 4)[0], 90);
  images.clear();
  StereoDisplay in_turns(std::make_unique<Shown>(&images), StereoLayout::frame_sequential);
  const auto shown_at = in_turns.show_eyes({dark, light});
  ASSERT_TRUE(shown_at);
  EXPECT_EQ(*shown_at, shifted(Stamp{}, 1)) << "the left image's moment";
  ASSERT_EQ(images.size(), 2U);
  EXPECT_EQ(images[0].at<cv::Vec3b>(0, 0)[0], 9);
  EXPECT_EQ(images[1].at<cv::Vec3b>(0, 0)[0], 90);
}

TEST(OpenDisplay, QuadBufferNeedsAMonitorOrAWindow) {
  const auto display = open_display(
      {.name = "screen", .kind = DisplayKind::offscreen, .size = {8, 6}, .stereo = StereoLayout::quad_buffer},
      nullptr);
  ASSERT_FALSE(display);
  EXPECT_NE(display.message().find("screen: expected a monitor or a window for quad_buffer"),
            std::string::npos)
      << display.message();
}

}  // namespace
}  // namespace limn::device
