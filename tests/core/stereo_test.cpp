#include "core/stereo.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

namespace limn {
namespace {

cv::Mat plain(int value) { return {6, 8, CV_8UC3, cv::Scalar::all(value)}; }

TEST(PackedImages, LieBesideEachOtherOrOneAboveTheOther) {
  const EyeImages images{plain(10), plain(200)};
  const cv::Mat beside = packed(images, StereoLayout::side_by_side, {8, 6});
  ASSERT_EQ(beside.size(), cv::Size(8, 6));
  EXPECT_EQ(beside.at<cv::Vec3b>(3, 3)[0], 10);
  EXPECT_EQ(beside.at<cv::Vec3b>(3, 4)[0], 200);
  const cv::Mat above = packed(images, StereoLayout::top_bottom, {8, 6});
  ASSERT_EQ(above.size(), cv::Size(8, 6));
  EXPECT_EQ(above.at<cv::Vec3b>(2, 5)[0], 10);
  EXPECT_EQ(above.at<cv::Vec3b>(3, 5)[0], 200);
}

TEST(PackedImages, AverageThePixelsThatShareOne) {
  cv::Mat stripes(6, 8, CV_8UC3, cv::Scalar::all(0));
  for (int column = 1; column < 8; column += 2) stripes.col(column).setTo(cv::Scalar::all(100));
  const cv::Mat beside = packed({stripes, plain(0)}, StereoLayout::side_by_side, {8, 6});
  EXPECT_EQ(beside.at<cv::Vec3b>(2, 1)[1], 50);
}

TEST(PackedImages, FillAnOddNumberOfPixels) {
  const cv::Mat beside = packed({plain(10), plain(200)}, StereoLayout::side_by_side, {7, 5});
  EXPECT_EQ(beside.at<cv::Vec3b>(4, 2)[0], 10);
  EXPECT_EQ(beside.at<cv::Vec3b>(4, 3)[0], 200);
  EXPECT_EQ(beside.at<cv::Vec3b>(4, 6)[0], 200);
}

TEST(PackedImages, AreTheSameTwiceWhereThereIsOneImage) {
  EXPECT_EQ(packed({plain(90)}, StereoLayout::top_bottom, {8, 6}).at<cv::Vec3b>(5, 5)[2], 90);
  EXPECT_EQ(both({plain(90)}).size(), cv::Size(16, 6));
}

TEST(MeanLight, IsThatOfTheLightAndNotOfTheDisplayValues) {
  const cv::Mat mean = mean_light({plain(255), plain(0)});
  EXPECT_EQ(mean.at<cv::Vec3b>(0, 0)[0], std::lround(255 * std::pow(0.5, 1 / 2.2)));
  EXPECT_EQ(mean_light({plain(77), plain(77)}).at<cv::Vec3b>(1, 1)[1], 77);
}

TEST(Eyes, AreApartAlongTheViewersXAxis) {
  const Imager viewer =
      viewer_imager(looking_at({0.3, -1, 0.8}, {0, 0, 0.1}, {0, 0, 1}).inverse(), 400, 300, 50);
  const auto [left, right] = eyes(viewer, 0.064);
  const Eigen::Vector3d p_left = left.imager_from_world.inverse().translation;
  const Eigen::Vector3d p_right = right.imager_from_world.inverse().translation;
  const Eigen::Vector3d d_right = viewer.imager_from_world.rotation.conjugate() * Eigen::Vector3d::UnitX();
  EXPECT_LT((p_right - p_left - 0.064 * d_right).norm(), 1e-12);
  EXPECT_LT((0.5 * (p_left + p_right) - viewer.imager_from_world.inverse().translation).norm(), 1e-12);
}

}  // namespace
}  // namespace limn
