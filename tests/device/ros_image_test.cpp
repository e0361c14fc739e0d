// Images of ROS 2's messages become frames; damaged messages never read beyond their bytes.
#include "device/ros_image.h"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "device/jpeg.h"
#include "tests/support/matchers.h"

namespace limn::device {
namespace {

using test::test_rng;
using Bytes = std::vector<std::uint8_t>;

struct Message {
  RosImage image;
  Bytes bytes;
};

// An image of random bytes, with `padding` bytes behind each row.
Message message_of(const std::string_view encoding,
                   int bytes_per_pixel,
                   std::uint32_t padding,
                   auto& random) {
  Message out;
  out.image = {false, encoding, 6, 4, 6 * static_cast<std::uint32_t>(bytes_per_pixel) + padding};
  out.bytes.resize(std::size_t{out.image.step} * 4);
  for (std::uint8_t& each : out.bytes) each = static_cast<std::uint8_t>(random());
  out.image.bytes = out.bytes;
  return out;
}

bool is_equal(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::norm(a, b, cv::NORM_INF) == 0;
}

std::string fault_of(const RosImage& image) {
  const auto frame = frame_of_ros(image);
  return frame ? "a frame" : frame.message();
}

TEST(RosImage, ChannelsComeInBgrWhateverTheirOrderAndStep) {
  auto random = test_rng();
  struct Case {
    const char* name;
    int channels;
    std::array<int, 3> bgr;
  };
  for (const Case& each : {Case{"bgr8", 3, {0, 1, 2}}, Case{"8UC3", 3, {0, 1, 2}}, Case{"rgb8", 3, {2, 1, 0}},
                           Case{"bgra8", 4, {0, 1, 2}}, Case{"rgba8", 4, {2, 1, 0}}}) {
    for (const std::uint32_t padding : {0U, 5U}) {
      const Message message = message_of(each.name, each.channels, padding, random);
      const auto frame = frame_of_ros(message.image);
      ASSERT_TRUE(frame) << frame.message();
      ASSERT_EQ(frame->image.type(), CV_8UC3);
      for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 6; ++x)
          for (std::size_t c = 0; c < 3; ++c)
            ASSERT_EQ(frame->image.at<cv::Vec3b>(y, x)[static_cast<int>(c)],
                      message.bytes[message.image.step * static_cast<std::size_t>(y) +
                                    static_cast<std::size_t>(x * each.channels + each.bgr[c])])
                << each.name;
    }
  }
}

TEST(RosImage, TheHighByteOf16BitsCountsInEitherOrder) {
  auto random = test_rng();
  Message message = message_of("mono16", 2, 3, random);
  for (const bool is_bigendian : {false, true}) {
    message.image.is_bigendian = is_bigendian;
    const auto frame = frame_of_ros(message.image);
    ASSERT_TRUE(frame) << frame.message();
    for (int y = 0; y < 4; ++y)
      for (int x = 0; x < 6; ++x)
        ASSERT_EQ(frame->image.at<std::uint8_t>(y, x),
                  message.bytes[static_cast<std::size_t>(15 * y + 2 * x + (is_bigendian ? 0 : 1))]);
  }
}

// A scene that is red throughout, as each pattern stores it.
TEST(RosImage, BayerPatternsGiveTheColour) {
  for (const std::string name : {"rggb", "bggr", "gbrg", "grbg"}) {
    Bytes bytes(64);
    for (std::size_t y = 0; y < 8; ++y)
      for (std::size_t x = 0; x < 8; ++x) bytes[8 * y + x] = name[2 * (y % 2) + x % 2] == 'r' ? 200 : 0;
    const std::string encoding = "bayer_" + name + "8";
    const auto frame = frame_of_ros({false, encoding, 8, 8, 8, false, bytes});
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_EQ(frame->image.at<cv::Vec3b>(4, 4), cv::Vec3b(0, 0, 200)) << name;
  }
}

TEST(RosImage, Yuv422GivesLumaAndColour) {
  Bytes uyvy, yuyv;
  for (int i = 0; i < 12; ++i) {
    const auto y = static_cast<std::uint8_t>(60 + i);
    uyvy.insert(uyvy.end(), {128, y, 128, y});
    yuyv.insert(yuyv.end(), {y, 128, y, 128});
  }
  for (const auto& [name, bytes] :
       {std::pair{"yuv422", uyvy}, {"uyvy", uyvy}, {"yuyv", yuyv}, {"yuv422_yuy2", yuyv}}) {
    const RosImage image{false, name, 6, 4, 12, false, bytes};
    const auto grey = frame_of_ros(image, true), colour = frame_of_ros(image);
    ASSERT_TRUE(grey && colour) << name;
    EXPECT_EQ(grey->image.at<std::uint8_t>(3, 5), 71) << name;
    EXPECT_EQ(colour->image.at<cv::Vec3b>(3, 5), cv::Vec3b(64, 64, 64)) << name;  // 255 / 219 (71 - 16)
  }
}

TEST(RosImage, CompressedImagesAreDecodedByTheirBytes) {
  cv::Mat image(40, 60, CV_8UC3);
  cv::randu(image, 0, 255);
  Bytes png;
  cv::imencode(".png", image, png);
  const Bytes jpeg = device::encode_jpeg(image, 90);
  const auto from_png = frame_of_ros({.is_compressed = true, .encoding = "jpeg", .bytes = png});
  ASSERT_TRUE(from_png) << from_png.message();
  EXPECT_TRUE(is_equal(from_png->image, image));
  const auto from_jpeg =
      frame_of_ros({.is_compressed = true, .encoding = "rgb8; jpeg compressed bgr8", .bytes = jpeg});
  ASSERT_TRUE(from_jpeg) << from_jpeg.message();
  EXPECT_TRUE(is_equal(from_jpeg->image, device::decode_frame({jpeg.begin(), jpeg.end()})->image));
  EXPECT_TRUE(from_jpeg->jpeg);
  const std::span half(jpeg.data(), jpeg.size() / 2);
  EXPECT_NE(fault_of({.is_compressed = true, .bytes = half}).find("expected a complete JPEG"),
            std::string::npos);
  EXPECT_NE(fault_of({.is_compressed = true, .encoding = "tiff", .bytes = Bytes(9)})
                .find("expected a JPEG or a PNG"),
            std::string::npos);
}

TEST(RosImage, WhatCannotBeIsRefusedInWords) {
  const Bytes bytes(72);
  const auto expect_fault = [&](const char* encoding, std::uint32_t width, std::uint32_t height,
                                std::uint32_t step, const char* words) {
    const std::string fault = fault_of({false, encoding, width, height, step, false, bytes});
    EXPECT_NE(fault.find(words), std::string::npos) << fault;
  };
  expect_fault("rgb8", 6, 4, 18, "a frame");
  expect_fault("32FC1", 6, 4, 24, "expected one of mono8, ");
  expect_fault("rgb8", 6, 4, 17, "step: expected at least 18 bytes");
  expect_fault("rgb8", 6, 5, 18, "data: expected 90 bytes");
  expect_fault("rgb8", 6, 4, 0xffffffff, "data: expected 17179869180 bytes");
  expect_fault("rgb8", 0, 4, 18, "found 0x4");
  expect_fault("rgb8", 0x80000002, 4, 6, "found 2147483650x4");
  expect_fault("bayer_rggb8", 5, 4, 6, "an even width and height");
}

// The bytes lie in memory of exactly their size, so that a sanitizer sees a read beyond them.
TEST(RosImage, RandomDamageNeverReadsBeyondTheBytes) {
  auto random = test_rng();
  const std::array names = {"mono8",        "mono16", "rgb8", "rgba16", "bayer_grbg8",
                            "bayer_rggb16", "uyvy",   "yuyv", "x"};
  int frames = 0;
  for (int i = 0; i < 3000; ++i) {
    const auto number = [&](std::uint32_t most) {
      return random() % 50 == 0 ? static_cast<std::uint32_t>(random())
                                : static_cast<std::uint32_t>(random() % most);
    };
    RosImage image{random() % 4 == 0, names[random() % names.size()], number(20), number(20), number(100)};
    Bytes bytes(random() % 1500);
    for (std::uint8_t& each : bytes) each = static_cast<std::uint8_t>(random());
    if (image.is_compressed && bytes.size() > 2) std::memcpy(bytes.data(), "\xff\xd8", 2);
    image.bytes = bytes;
    const auto frame = frame_of_ros(image, random() % 2 == 0);
    if (!frame) continue;
    ++frames;
    EXPECT_EQ(frame->image.size(), cv::Size(static_cast<int>(image.width), static_cast<int>(image.height)));
  }
  EXPECT_GT(frames, 100);
}

}  // namespace
}  // namespace limn::device
