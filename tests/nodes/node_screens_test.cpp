// Screens that are plugged into a node: their images come from the host.
#include "nodes/node_screens.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <opencv2/core.hpp>
#include <thread>

#include "core/version.h"
#include "device/offscreen_display.h"
#include "nodes/remote_devices.h"
#include "nodes/remote_screen.h"
#include "tests/nodes/memory_room.h"

namespace limn::nodes {
namespace {

using namespace std::chrono_literals;

const cv::Size k_size(320, 180);

// A link on which a screen's image takes long, as on a slow network; it counts them.
class SlowLink final : public RoomLink {
 public:
  SlowLink(test::MemoryRoom* room, const std::string& node, std::chrono::milliseconds delay)
      : link_(room, node), delay_(delay) {}
  const Sender& self() const override { return link_.self(); }
  Status send(const Message& message) override {
    if (std::holds_alternative<ScreenImage>(message)) {
      ++images;
      std::this_thread::sleep_for(delay_);
    }
    return link_.send(message);
  }
  std::vector<Received> take_messages(std::chrono::nanoseconds wait) override {
    return link_.take_messages(wait);
  }
  static inline std::atomic<int> images = 0;

 private:
  test::MemoryLink link_;
  std::chrono::milliseconds delay_;
};

device::DisplayConfig screen(device::DisplayKind kind = device::DisplayKind::offscreen) {
  return {.name = "screen0", .host = "left", .kind = kind, .size = k_size};
}

// Smooth, so that JPEG changes it little.
cv::Mat image_of(int blue) {
  cv::Mat out(k_size, CV_8UC3);
  for (int y = 0; y < out.rows; ++y)
    for (int x = 0; x < out.cols; ++x)
      out.at<cv::Vec3b>(y, x) = {cv::saturate_cast<uchar>(blue), cv::saturate_cast<uchar>(x / 2),
                                 cv::saturate_cast<uchar>(y)};
  return out;
}

// A host, and the node `left` with one screen.
class NodeScreensTest : public ::testing::Test {
 protected:
  void open(const device::DisplayConfig& config, std::chrono::milliseconds delay = 0ms) {
    SlowLink::images = 0;
    display_.reset();  // its thread sends through the host
    host_ = std::make_unique<Room>(std::make_unique<SlowLink>(&room_, "host", delay));
    node_ = std::make_unique<Room>(std::make_unique<test::MemoryLink>(&room_, "left"));
    ASSERT_TRUE(host_->offer({.is_host = true, .version = std::string(version())}).ok());
    ASSERT_TRUE(node_->offer({.version = std::string(version())}).ok());
    ASSERT_TRUE(holds([&] { return host_->find("left") && node_->host(); }));
    config_ = config;
    device::Devices devices;
    devices.displays = {config};
    screens_.set_devices(devices, Rig(), "left");
    auto display = RoomOpener(host_.get(), nullptr, {"screen0"}).display(config);
    ASSERT_TRUE(display) << display.message();
    display_ = std::move(*display);
  }

  template <class Condition>
  static bool holds(const Condition& condition) {
    for (const Stamp end = shifted(now(), 10); now() < end; std::this_thread::sleep_for(5ms))
      if (condition()) return true;
    return false;
  }
  // What the node does between its frames.
  void step_node() {
    screens_.receive(node_->take_screen_images());
    screens_.show();
    Health health;
    screens_.report(&health);
    ASSERT_TRUE(node_->send(health));
  }
  // Shows an image in each frame until something is so.
  template <class Condition>
  bool play(const EyeImages& images, const Condition& condition) {
    return holds([&] {
      last_ = display_->show_eyes(images);
      step_node();
      return condition();
    });
  }
  cv::Mat shown() {
    const auto display = displays_.display(screen_at_node(config_));
    const auto* offscreen = display ? dynamic_cast<const device::OffscreenDisplay*>(*display) : nullptr;
    return offscreen ? offscreen->image() : cv::Mat();
  }
  bool shows(const cv::Mat& image) {
    const cv::Mat found = shown();
    return found.size() == image.size() && cv::norm(found, image, cv::NORM_INF) <= 6;
  }

  test::MemoryRoom room_;
  std::unique_ptr<Room> host_, node_;
  NodeDisplays displays_{nullptr};
  NodeScreens screens_{&displays_};
  device::DisplayConfig config_;
  std::unique_ptr<device::Display> display_;
  Result<Stamp> last_ = Stamp();
};

TEST_F(NodeScreensTest, ShowTheHostsImages) {
  open(screen());
  for (const int blue : {40, 200}) {
    EXPECT_TRUE(play({image_of(blue)}, [&] { return shows(image_of(blue)); })) << blue;
    EXPECT_TRUE(last_) << last_.message();
  }
  screens_.clear();
  EXPECT_TRUE(display_->show(cv::Mat(k_size, CV_8UC3, cv::Scalar::all(0))));
  EXPECT_TRUE(play({cv::Mat(k_size, CV_8UC3, cv::Scalar::all(0))},
                   [&] { return cv::countNonZero(shown().reshape(1)) == 0; }));
  EXPECT_FALSE(display_->show(cv::Mat(10, 10, CV_8UC3)));
}

TEST_F(NodeScreensTest, GetBothEyesImages) {
  device::DisplayConfig stereo = screen();
  stereo.stereo = StereoLayout::side_by_side;
  open(stereo);
  EXPECT_TRUE(display_->is_stereo());
  std::vector<ScreenImage> images;
  ASSERT_TRUE(holds([&] {
    EXPECT_TRUE(display_->show_eyes({image_of(10), image_of(20)}));
    images = node_->take_screen_images();
    return !images.empty();
  }));
  EXPECT_FALSE(images[0].right.empty());
  EXPECT_NE(images[0].left, images[0].right);
  screens_.receive(images);
  std::this_thread::sleep_for(100ms);
  screens_.show();
  Health health;
  screens_.report(&health);
  EXPECT_TRUE(health.screen_problems.empty()) << health.screen_problems[0];
}

TEST_F(NodeScreensTest, NeverDelayTheHostNorFloodTheNetwork) {
  open(screen(), 700ms);
  double longest_s = 0;
  for (const Stamp end = shifted(now(), 1.5); now() < end; std::this_thread::sleep_for(5ms)) {
    const Stamp begun = now();
    EXPECT_TRUE(display_->show(image_of(90)));
    longest_s = std::max(longest_s, seconds_between(begun, now()));
  }
  EXPECT_LT(longest_s, 0.4);
  EXPECT_GE(SlowLink::images, 2);
  EXPECT_LE(SlowLink::images, 3);

  open(screen());
  const Stamp begun = now();
  while (seconds_between(begun, now()) < 1) EXPECT_TRUE(display_->show(image_of(90)));
  EXPECT_GE(SlowLink::images, 3);
  EXPECT_LE(SlowLink::images, 16 * seconds_between(begun, now()) + 1);
}

TEST_F(NodeScreensTest, SayWhatIsWrongWithoutTheProjectors) {
  open(screen(device::DisplayKind::window));
  ASSERT_TRUE(play({image_of(1)}, [&] { return !last_; }));
  EXPECT_NE(last_.message().find("left: screen0: expected a desktop"), std::string::npos) << last_.message();
  const auto projector =
      RemoteDisplay::open(host_.get(), {.name = "projector0", .host = "left", .size = k_size});
  ASSERT_TRUE(projector);
  const Result<Stamp> shown_at = (*projector)->show_eyes({image_of(1)});
  EXPECT_TRUE(shown_at) << shown_at.message();
  node_.reset();
  EXPECT_TRUE(holds([&] { return !host_->find("left"); }));
  const Result<Stamp> gone = display_->show(image_of(1));
  ASSERT_FALSE(gone);
  EXPECT_NE(gone.message().find("expected the machine left in the room"), std::string::npos)
      << gone.message();
}

TEST_F(NodeScreensTest, ADamagedImageIsAProblemUntilTheNextOne) {
  open(screen());
  const auto problems = [&] {
    Health health;
    screens_.show();
    screens_.report(&health);
    return health.screen_problems;
  };
  screens_.receive(
      {{.to = "left", .screen = "screen0", .left = "no JPEG"}, {.to = "left", .screen = "other"}});
  EXPECT_TRUE(holds([&] { return problems().size() == 1; }));
  EXPECT_TRUE(play({image_of(60)}, [&] { return shows(image_of(60)); }));
  EXPECT_TRUE(problems().empty());
}

}  // namespace
}  // namespace limn::nodes
