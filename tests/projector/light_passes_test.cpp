// The rectangles in which a projector may give light.
#include "projector/light_passes.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <random>

namespace limn::projector {
namespace {

std::vector<cv::Rect> some_rectangles(std::mt19937* random, int most) {
  const auto upto = [&](int last) { return std::uniform_int_distribution<int>(0, last)(*random); };
  std::vector<cv::Rect> rectangles(static_cast<std::size_t>(upto(most)));
  for (cv::Rect& r : rectangles) r = {upto(40), upto(30), 1 + upto(20), 1 + upto(15)};
  return rectangles;
}

// For each pixel, the number of rectangles that contain it.
cv::Mat counted(const std::vector<cv::Rect>& rectangles) {
  cv::Mat count = cv::Mat::zeros(60, 80, CV_8U);
  for (const cv::Rect& r : rectangles) count(r) += 1;
  return count;
}

TEST(PlacesByMode, HaveEachPixelOnceAndByTheModesThatAskForIt) {
  std::mt19937 random(5);
  PlacesByMode places;
  int in_both = 0;
  for (int round = 0; round < 300; ++round) {
    const std::vector<cv::Rect> view = some_rectangles(&random, 5), surface = some_rectangles(&random, 5);
    places.divide(view, surface);
    const cv::Mat is_view = counted(view) > 0, is_surface = counted(surface) > 0;
    const cv::Mat expected[] = {is_view & ~is_surface, is_surface & ~is_view, is_view & is_surface};
    for (std::size_t i = 0; i < 3; ++i) {
      const cv::Mat found = counted(*places.each()[i]);
      EXPECT_EQ(cv::norm(found, expected[i] & 1, cv::NORM_INF), 0) << "mode " << i << ", round " << round;
    }
    in_both += cv::countNonZero(expected[2]);
  }
  EXPECT_GT(in_both, 5000);  // the rectangles do overlap
}

}  // namespace
}  // namespace limn::projector
