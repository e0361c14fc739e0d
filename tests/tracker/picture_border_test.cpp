#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"

// Markers whose white margin is cut off by the picture's border.
namespace limn::tracker {
namespace {

// A marker in the middle of a picture, and the picture cut so that the marker's outermost corner lies
// `distance_px` inside the new border `side` (0: top, 1: right, 2: bottom, 3: left).
struct CutPicture {
  cv::Mat grey;
  std::array<Eigen::Vector2d, 4> corners_px;
};

CutPicture cut_picture(
    const PlacedMarker& marker, std::size_t side, int distance_px, double blur_px, std::mt19937_64& rng) {
  const cv::Mat whole = test::image_of(pinhole_vga(), test::plain(640, 480, 90), std::vector{marker},
                                       {.blur_px = blur_px, .noise_levels = 2}, rng);
  auto corners = test::true_corners(pinhole_vga(), marker);
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& corner : corners) box.extend(corner);
  // The outermost pixels that have ink.
  const cv::Point low(static_cast<int>(std::floor(box.min().x() + 0.5)),
                      static_cast<int>(std::floor(box.min().y() + 0.5)));
  const cv::Point high(static_cast<int>(std::floor(box.max().x() + 0.5)),
                       static_cast<int>(std::floor(box.max().y() + 0.5)));
  cv::Rect part(0, 0, 640, 480);
  if (side == 0) part = {0, low.y - distance_px, 640, 480 - low.y + distance_px};
  if (side == 1) part = {0, 0, high.x + distance_px + 1, 480};
  if (side == 2) part = {0, 0, 640, high.y + distance_px + 1};
  if (side == 3) part = {low.x - distance_px, 0, 640 - low.x + distance_px, 480};
  for (Eigen::Vector2d& corner : corners) corner -= Eigen::Vector2d(part.x, part.y);
  return {whole(part).clone(), corners};
}

TEST(PictureBorder, CutsOffTheMarginOfMarkersThatAreStillFound) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_50", "apriltag_36h11"}));
  for (int i = 0; i < 48; ++i) {
    const MarkerName name{i % 2 ? "apriltag_36h11" : "aruco_4x4_50", std::to_string(i)};
    const double spin = i % 3 ? uniform(rng, -0.1, 0.1) + (i % 4) * 90_deg : uniform(rng, 0, 6.28);
    const PlacedMarker marker = test::placed(pinhole_vga(), name, {320, 240}, uniform(rng, 50, 140), spin,
                                             uniform(rng, 0, 30_deg), i);
    const auto side = static_cast<std::size_t>(i / 2 % 4);
    const int distance_px = std::array{2, 3, 5, 9}[static_cast<std::size_t>(i / 8 % 4)];
    const CutPicture picture = cut_picture(marker, side, distance_px, i % 5 ? 0.5 : 0.8, rng);
    SCOPED_TRACE(std::to_string(distance_px) + " px from side " + std::to_string(side) + ", " + name.text());
    const auto found = detector.detect(picture.grey);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].marker, name);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_TRUE(test::near(found[0].corners_px[k], picture.corners_px[k], 0.25));
      EXPECT_TRUE(cv::Rect2d(-0.5, -0.5, picture.grey.cols, picture.grey.rows)
                      .contains({found[0].corners_px[k].x(), found[0].corners_px[k].y()}));
    }
  }
}

TEST(PictureBorder, MovesNoCorner) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_50"}));
  double outward = 0, normalised = 0;
  constexpr int k_count = 40;
  for (int i = 0; i < k_count; ++i) {
    const PlacedMarker marker =
        test::placed(pinhole_vga(), {"aruco_4x4_50", std::to_string(i)}, {320.3, 240.1},
                     uniform(rng, 60, 120), uniform(rng, -0.04, 0.04), 0, 0);
    const CutPicture picture = cut_picture(marker, 0, 2, 0.5, rng);
    const auto found = detector.detect(picture.grey);
    ASSERT_EQ(found.size(), 1u) << i;
    for (const std::size_t k : {0u, 1u}) {  // the upper corners
      const Eigen::Vector2d e = found[0].corners_px[k] - picture.corners_px[k];
      outward -= e.y() / (2 * k_count);
      normalised += 0.5 * e.dot(found[0].corner_covariance[k].inverse() * e) / (2 * k_count);
    }
  }
  EXPECT_LT(std::abs(outward), 0.03);
  EXPECT_LT(normalised, 2);
}

}  // namespace
}  // namespace limn::tracker
