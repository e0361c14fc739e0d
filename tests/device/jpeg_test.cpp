#include "device/jpeg.h"

#include <turbojpeg.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/support/matchers.h"

namespace limn::device {
namespace {

cv::Mat ramp() {
  cv::Mat image(48, 64, CV_8UC3);
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      image.at<cv::Vec3b>(y, x) = {static_cast<uchar>(3 * x), static_cast<uchar>(5 * y), 60};
  return image;
}

std::vector<uchar> encoded(const cv::Mat& image) {
  std::vector<uchar> bytes;
  cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, 98});
  return bytes;
}

// The image as JPEG with this chroma subsampling (TJSAMP_…).
std::vector<uchar> sampled(const cv::Mat& image, int sampling) {
  const tjhandle encoder = tjInitCompress();
  unsigned char* data = nullptr;
  unsigned long size = 0;
  EXPECT_EQ(tjCompress2(encoder, image.data, image.cols, static_cast<int>(image.step), image.rows, TJPF_BGR,
                        &data, &size, sampling, 95, 0),
            0);
  const std::vector<uchar> bytes(data, data + size);
  tjFree(data);
  tjDestroy(encoder);
  return bytes;
}

// The JPEG without the segments of this marker (0xc4: Huffman tables).
std::vector<uchar> without_segments(const std::vector<uchar>& jpeg, uchar marker) {
  std::vector<uchar> kept(jpeg.begin(), jpeg.begin() + 2);
  for (std::size_t at = 2; at + 4 < jpeg.size();) {
    const std::size_t size =
        jpeg[at + 1] == 0xda ? jpeg.size() - at : 2u + 256u * jpeg[at + 2] + jpeg[at + 3];
    if (jpeg[at + 1] != marker)
      kept.insert(kept.end(), jpeg.begin() + static_cast<long>(at),
                  jpeg.begin() + static_cast<long>(at + size));
    at += size;
  }
  return kept;
}

TEST(Jpeg, DecodesColourAndBrightnessAlone) {
  const auto bytes = encoded(ramp());
  const auto colour = decode_jpeg(bytes, {.size = {64, 48}});
  ASSERT_TRUE(colour) << colour.message();
  EXPECT_TRUE(test::image_near(*colour, ramp(), 2, 16, "colour"));
  const auto grey = decode_jpeg(bytes, {.grey = true});
  ASSERT_TRUE(grey);
  EXPECT_EQ(grey->type(), CV_8UC1);
  EXPECT_NEAR(grey->at<uchar>(40, 60), 0.114 * 180 + 0.587 * 200 + 0.299 * 60, 4);
}

TEST(Jpeg, AnImageOfOneChannelStaysGrey) {
  const auto grey = decode_jpeg(encoded(cv::Mat(16, 16, CV_8U, cv::Scalar(90))));
  ASSERT_TRUE(grey);
  EXPECT_EQ(grey->type(), CV_8UC1);
}

TEST(Jpeg, TablesThatWebcamsLeaveOutAreTheStandards) {
  const auto bytes = encoded(ramp());
  const auto bare = without_segments(bytes, 0xc4);
  ASSERT_LT(bare.size() + 400, bytes.size());
  const auto image = decode_jpeg(bare);
  ASSERT_TRUE(image) << image.message();
  EXPECT_TRUE(test::image_near(*image, ramp(), 2, 16, "bare"));
}

TEST(Jpeg, AnImageWithoutEndMarkIsWhole) {
  auto bytes = encoded(ramp());
  const cv::Mat whole = decode_jpeg(bytes).value();
  bytes.resize(bytes.size() - 2);
  const auto image = decode_jpeg(bytes);
  ASSERT_TRUE(image) << image.message();
  EXPECT_TRUE(test::image_near(*image, whole, 0, 0, "image"));
  EXPECT_TRUE(decode_frame({bytes.begin(), bytes.end()}));
}

TEST(Jpeg, NoHalfImages) {
  const auto bytes = encoded(ramp());
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{3}, std::size_t{200}, bytes.size() / 2, bytes.size() - 20}) {
    const auto half = decode_jpeg({bytes.data(), size});
    ASSERT_FALSE(half) << size;
    EXPECT_NE(half.message().find("truncated or damaged"), std::string::npos) << half.message();
  }
}

TEST(Jpeg, AnotherSizeIsNamed) {
  const auto other = decode_jpeg(encoded(ramp()), {.size = {64, 50}});
  ASSERT_FALSE(other);
  EXPECT_NE(other.message().find("64x50, found 64x48"), std::string::npos) << other.message();
}

TEST(Jpeg, SizeIsKnownBeforeAnythingIsDecoded) {
  auto bytes = encoded(ramp());
  const auto size = jpeg_size(bytes);
  ASSERT_TRUE(size) << size.message();
  EXPECT_EQ(*size, cv::Size(64, 48));
  bytes.resize(40);
  EXPECT_FALSE(jpeg_size(bytes));
}

TEST(Jpeg, LargeImagesComeOutSmaller) {
  const auto bytes = encoded(ramp());
  const auto same = decode_jpeg(bytes, {.longest_side = 64});
  ASSERT_TRUE(same);
  EXPECT_EQ(same->size(), cv::Size(64, 48));
  const auto half = decode_jpeg(bytes, {.longest_side = 32});
  ASSERT_TRUE(half);
  cv::Mat expected;
  cv::resize(ramp(), expected, {32, 24}, 0, 0, cv::INTER_AREA);
  EXPECT_TRUE(test::image_near(*half, expected, 2, 16, "half"));
  const auto least = decode_jpeg(bytes, {.longest_side = 2});
  ASSERT_TRUE(least);
  EXPECT_EQ(least->size(), cv::Size(8, 6));
}

TEST(Jpeg, AFrameHoldsItsBrightnessAndItsBytes) {
  const cv::Mat odd = ramp()(cv::Rect(0, 0, 61, 47));
  for (const int sampling : {TJSAMP_444, TJSAMP_422, TJSAMP_420}) {
    const std::vector<uchar> bytes = sampled(odd, sampling);
    const std::string jpeg(bytes.begin(), bytes.end());
    const auto frame = decode_frame(jpeg, {.size = odd.size()});
    ASSERT_TRUE(frame) << frame.message();
    EXPECT_TRUE(test::image_near(frame->image, odd, 4, 40, "frame"));
    EXPECT_TRUE(test::image_near(frame->grey, *decode_jpeg(bytes, {.grey = true}), 0, 0, "brightness"));
    EXPECT_EQ(*frame->jpeg, jpeg);
    EXPECT_FALSE(decode_frame(jpeg.substr(0, jpeg.size() / 2)));
    EXPECT_FALSE(decode_frame(jpeg, {.size = {64, 48}}));
    const auto grey = decode_frame(jpeg, {.grey = true});
    ASSERT_TRUE(grey);
    EXPECT_TRUE(test::image_near(grey->image, frame->grey, 0, 0, "grey"));
    EXPECT_FALSE(grey->jpeg) << "otherwise a recording would show colours that the session did not use";
  }
  EXPECT_FALSE(decode_frame(""));
}

TEST(Jpeg, WhatIsEncodedIsDecodedAgain) {
  const auto colour = decode_jpeg(encode_jpeg(ramp(), 95));
  ASSERT_TRUE(colour) << colour.message();
  EXPECT_TRUE(test::image_near(*colour, ramp(), 3, 24, "colour"));
  const cv::Mat grey(17, 9, CV_8U, cv::Scalar(90));
  const auto again = decode_jpeg(encode_jpeg(grey, 95));
  ASSERT_TRUE(again);
  EXPECT_TRUE(test::image_near(*again, grey, 1, 1, "grey"));
}

}  // namespace
}  // namespace limn::device
