// Cameras of ROS 2, which is not installed here: ros_peer.cpp publishes their images by Cyclone DDS alone.
#include "nodes/ros_camera.h"

#include <opencv2/core.hpp>

#include "core/file.h"
#include "device/jpeg.h"
#include "nodes/remote_devices.h"
#include "tests/nodes/ros_peer_process.h"
#include "tests/support/matchers.h"

namespace limn::nodes {
namespace {

class RosCameras : public Ros {
 protected:
  static device::CameraConfig config_of(const std::string& topic, cv::Size size = {}, double limit_s = 2) {
    return {.name = "camera0", .source = "ros:" + topic, .size = size, .limit_s = limit_s};
  }
  static std::string fault_of(const device::CameraConfig& config) {
    const auto camera = open_camera_here(config);
    return camera ? "opened" : camera.message();
  }
};

// What ros_peer fills its rows of 200 bytes with.
std::uint8_t byte_at(int y, int i) { return static_cast<std::uint8_t>((200 * y + i) * 7 + y); }

TEST_F(RosCameras, ImagesArriveWithEveryBitAndTheirStamps) {
  const RosPeer peer(domain, "images");
  RoomOpener opener(nullptr, nullptr);  // as limn live, calibrate and recheck open their cameras
  const auto camera = opener.camera(config_of("/camera/image_raw"));
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ((*camera)->size(), cv::Size(64, 48));
  Stamp last;
  for (int k = 0; k < 5; ++k) {
    const auto frame = (*camera)->next();
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_GT(frame->captured_at, last);
    EXPECT_LT(seconds_between(frame->captured_at, now()), 0.5);
    EXPECT_LE(frame->captured_at, now());
    last = frame->captured_at;
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 64; ++x)
        ASSERT_EQ(frame->image.at<cv::Vec3b>(y, x),
                  cv::Vec3b(byte_at(y, 3 * x + 2), byte_at(y, 3 * x + 1), byte_at(y, 3 * x)));
  }
  EXPECT_NE((*camera)->description().find("sensor_msgs/Image, 64x48"), std::string::npos);
  EXPECT_NE((*camera)->description().find("stamps: the sender's"), std::string::npos);
}

TEST_F(RosCameras, CompressedImagesArriveBesideOthersAndReliableOnesToo) {
  cv::Mat image(48, 64, CV_8UC3);
  cv::randu(image, 0, 255);
  const auto jpeg = device::encode_jpeg(image, 90);
  const auto file = test::test_folder() / "image.jpg";
  ASSERT_TRUE(write_file(file, std::string(jpeg.begin(), jpeg.end())));
  ::setenv("JPEG", file.c_str(), 1);
  const RosPeer peer(domain, "images");
  const auto compressed = open_camera_here(config_of("/camera/image_raw/compressed"));
  const auto grey = open_camera_here(config_of("/camera/grey", {64, 48}));
  ASSERT_TRUE(compressed) << compressed.message();
  ASSERT_TRUE(grey) << grey.message();
  const auto frame = (*compressed)->next(), levels = (*grey)->next();
  ASSERT_TRUE(frame) << frame.message();
  EXPECT_EQ(cv::norm(frame->image, device::decode_frame({jpeg.begin(), jpeg.end()})->image, cv::NORM_INF), 0);
  ASSERT_TRUE(frame->jpeg);
  EXPECT_EQ(*frame->jpeg, std::string(jpeg.begin(), jpeg.end()));
  ASSERT_TRUE(levels) << levels.message();
  EXPECT_EQ(levels->image.at<std::uint8_t>(47, 63), byte_at(47, 63));
  EXPECT_NE((*grey)->description().find("stamps: one is 0, so the arrival's"), std::string::npos);
}

TEST_F(RosCameras, WhatIsWrongIsSaidInWords) {
  const RosPeer peer(domain, "images");
  const auto expect_fault = [](const device::CameraConfig& config, const std::string& words) {
    const std::string fault = fault_of(config);
    EXPECT_NE(fault.find(words), std::string::npos) << fault;
  };
  expect_fault(config_of("/camera/odd", {64, 48}, 0.5), "expected one of mono8, ");
  expect_fault(config_of("/camera/image_raw", {640, 480}, 0.5), "expected 640x480, found 64x48");
  expect_fault(config_of("image raw"), "Write ros:/camera/image_raw");
  auto locked = config_of("/camera/image_raw");
  locked.sensor.gain = 1;
  expect_fault(locked, "expected no exposure_ms");
  // Cameras of a known size may come later.
  for (const auto& [topic, words] :
       {std::pair{"/camera/nobody", "nobody publishes it in domain"},
        {"/camera/pose", "it carries geometry_msgs/PoseStamped, which is no image"}}) {
    const auto late = open_camera_here(config_of(topic, {64, 48}, 0.5));
    ASSERT_TRUE(late) << late.message();
    const auto none = (*late)->next();
    ASSERT_FALSE(none);
    EXPECT_NE(none.message().find(words), std::string::npos) << none.message();
    EXPECT_NE(none.message().find("Topics with images there: /camera/grey, /camera/image_raw, "
                                  "/camera/image_raw/compressed, /camera/odd"),
              std::string::npos)
        << none.message();
  }
}

TEST_F(RosCameras, AnImageOfAnotherSizeIsLeftOut) {
  const RosPeer peer(domain, "images");
  const auto camera = open_camera_here(config_of("/camera/shrinking", {64, 48}, 0.2));
  ASSERT_TRUE(camera) << camera.message();
  std::string fault;
  for (const Stamp end = now() + k_longest; fault.empty() && now() < end;)
    if (const auto frame = (*camera)->next(); !frame) fault = frame.message();
  EXPECT_NE(fault.find("expected 64x48, found 32x48. Set the camera to that size"), std::string::npos)
      << fault;
}

// 30 images of 6 MB in a second. A busy machine may lose some, but not most.
TEST_F(RosCameras, LargeImagesArrive) {
  const RosPeer peer(domain, "hd");
  const auto camera = open_camera_here(config_of("/camera/image_raw"));
  ASSERT_TRUE(camera) << camera.message();
  EXPECT_EQ((*camera)->size(), cv::Size(1920, 1080));
  int frames = 0;
  for (const Stamp end = shifted(now(), 30); frames < 8 && now() < end;) frames += (*camera)->next().ok();
  EXPECT_EQ(frames, 8);
}

}  // namespace
}  // namespace limn::nodes
