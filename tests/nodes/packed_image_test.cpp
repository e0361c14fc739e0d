#include "nodes/packed_image.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <random>

namespace limn::nodes {
namespace {

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && (a.empty() || cv::norm(a, b, cv::NORM_INF) == 0);
}

cv::Mat random_image(std::mt19937_64& rng, int channels, unsigned levels) {
  cv::Mat image(1 + static_cast<int>(rng() % 60), 1 + static_cast<int>(rng() % 60),
                CV_MAKETYPE(CV_8U, channels));
  for (auto* at = image.data; at != image.data + image.total() * image.elemSize(); ++at)
    *at = static_cast<std::uint8_t>(rng() % levels * 85);
  return image;
}

TEST(PackedImage, ComesBackAsItWas) {
  std::mt19937_64 rng(7);
  for (const int channels : {1, 3, 4})
    for (const unsigned levels : {1u, 2u, 4u, 256u})
      for (int i = 0; i < 50; ++i) {
        const cv::Mat image = random_image(rng, channels, levels);
        const auto back = unpacked(packed(image), image.size(), channels);
        ASSERT_TRUE(back) << back.message();
        EXPECT_TRUE(same(*back, image)) << channels << " channels, " << levels << " levels";
      }
}

TEST(PackedImage, APartOfAnImageComesBack) {
  std::mt19937_64 rng(8);
  cv::Mat whole(100, 100, CV_8UC3);
  cv::randu(whole, 0, 256);
  const cv::Mat part = whole(cv::Rect(10, 20, 33, 44));
  EXPECT_TRUE(same(unpacked(packed(part), part.size(), 3).value(), part));
}

TEST(PackedImage, AnEmptyImageComesBackEmpty) {
  EXPECT_TRUE(packed(cv::Mat()).empty());
  EXPECT_TRUE(unpacked({}, {}, 0).value().empty());
}

TEST(PackedImage, EvenAreasTakeFewBytes) {
  cv::Mat map(50, 80, CV_8UC1, cv::Scalar(255));
  map(cv::Rect(20, 10, 30, 20)) = 40;
  EXPECT_LT(packed(map).size(), 60u);
  cv::Mat sign(400, 400, CV_8UC3, cv::Scalar(255, 255, 255));  // as a code of 40 x 40 squares
  std::mt19937_64 rng(9);
  for (int row = 0; row < 40; ++row)
    for (int column = 0; column < 40; ++column)
      if (rng() % 2 == 0) sign(cv::Rect(10 * column, 10 * row, 10, 10)) = cv::Scalar();
  EXPECT_LT(packed(sign).size(), 10000u);
}

TEST(PackedImage, NoiseTakesHardlyMoreThanItself) {
  cv::Mat noise(200, 200, CV_8UC1);
  cv::randu(noise, 0, 256);
  EXPECT_LT(packed(noise).size(), 40000u + 1000u);
}

TEST(PackedImage, DamagedBytesAreRefusedOrGiveAnImage) {
  std::mt19937_64 rng(10);
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    const cv::Mat image = random_image(rng, 3, 3);
    auto bytes = packed(image);
    if (i % 3 == 0) bytes.resize(rng() % bytes.size());
    if (i % 3 == 1) bytes[rng() % bytes.size()] ^= static_cast<std::uint8_t>(1 + rng() % 255);
    if (i % 3 == 2) bytes.push_back(static_cast<std::uint8_t>(rng()));
    const auto back = unpacked(bytes, image.size(), 3);
    if (!back)
      ++refused;
    else
      EXPECT_EQ(back->size(), image.size());
  }
  EXPECT_GT(refused, 2000);
}

TEST(PackedImage, HugeSizesAreRefusedWithoutMemory) {
  const std::vector<std::uint8_t> bytes = {0xff, 0xff, 0xff, 0xff, 0x7f, 1};
  for (const cv::Size size : {cv::Size(2'000'000'000, 2'000'000'000), cv::Size(-1, 5), cv::Size(0, 5),
                              cv::Size(5, 0), cv::Size(1 << 22, 2)})
    EXPECT_FALSE(unpacked(bytes, size, 1)) << size.width;
  EXPECT_FALSE(unpacked(bytes, {4, 4}, 2));
}

}  // namespace
}  // namespace limn::nodes
