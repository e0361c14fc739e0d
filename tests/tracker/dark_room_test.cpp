#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"
#include "tracker/threshold.h"

// Paper of 40 levels and ink of 8, with noise of 3.
namespace limn::tracker {
namespace {

constexpr test::ImageOptions k_dark{.black = 8, .white = 40, .blur_px = 0.7, .noise_levels = 3};

TEST(DarkRoom, ShowsItsMarkers) {
  auto rng = test::test_rng();
  const std::vector<std::string> names = {"aruco_4x4_50", "apriltag_36h11", "apriltag_16h5"};
  int markers = 0, right = 0;
  for (const std::string& family : names) {
    Detector detector(families({family}));
    for (int i = 0; i < 24; ++i) {
      const MarkerName name{family, std::to_string(i)};
      const PlacedMarker marker =
          test::placed(pinhole_vga(), name, {320, 240}, uniform(rng, 26, 190), uniform(rng, 0, 6.28),
                       uniform(rng, 0, 40_deg), uniform(rng, 0, 6.28));
      const int ground = static_cast<int>(uniform(rng, 10, 34));
      ++markers;
      for (const Detection& found : detector.detect(test::image_of(
               pinhole_vga(), test::plain(640, 480, ground), std::vector{marker}, k_dark, rng))) {
        EXPECT_EQ(found.marker, name);
        const auto truth = test::true_corners(pinhole_vga(), marker);
        if (test::near(found.corners_px[0], truth[0], 0.6)) ++right;
      }
    }
  }
  EXPECT_GE(right, 0.95 * markers);
}

// Black pixels, by the codes of the corners at their upper left.
int black_pixels(const cv::Mat& grey, const ThresholdOptions& options) {
  CornerCodes corners;
  WorkerTeam alone(1);
  Threshold().apply(grey, options, corners, alone);
  int count = 0;
  for (int y = 0; y < grey.rows; ++y)
    for (int x = 0; x < grey.cols; ++x) count += (*corners.at(x, y) & CornerCodes::k_lower_right) != 0;
  return count;
}

TEST(DarkRoom, HasNoBlackRegionsWhereItIsFlat) {
  auto rng = test::test_rng();
  cv::Mat flat;
  test::plain(640, 480, 40).convertTo(flat, CV_32F);
  const cv::Mat grey = test::noisy_grey(flat, 3, rng);
  EXPECT_GT(black_pixels(grey, {}), 20000);
  EXPECT_LT(black_pixels(grey, {.above_noise = true}), 1000);
}

TEST(DarkRoom, IsNotAssumedInAnImageOfClutter) {
  auto rng = test::test_rng();
  const cv::Mat grey = test::clutter(640, 480, rng);
  EXPECT_EQ(black_pixels(grey, {.above_noise = true}), black_pixels(grey, {}));
}

}  // namespace
}  // namespace limn::tracker
