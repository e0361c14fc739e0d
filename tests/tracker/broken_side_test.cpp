#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"

// Codes of few bits with something over one of their sides.
namespace limn::tracker {
namespace {

// The light of a marker with a round spot over a side, which touches no cell of the code.
struct Spotted {
  cv::Mat light;
  std::array<Eigen::Vector2d, 4> corners_px;
};

Spotted spotted(
    const MarkerName& name, std::size_t side, double outward_share, double level, std::mt19937_64& rng) {
  const PlacedMarker marker = test::placed(
      pinhole_vga(), name, {uniform(rng, 300, 340), uniform(rng, 220, 260)}, uniform(rng, 70, 180),
      uniform(rng, 0, 6.28), uniform(rng, 0, 25_deg), uniform(rng, 0, 6.28));
  Spotted result{
      test::light_of(pinhole_vga(), test::plain(640, 480, 70), std::vector{marker}, {.white = 170}, rng),
      test::true_corners(pinhole_vga(), marker)};
  const auto& c = result.corners_px;
  const Eigen::Vector2d along = c[(side + 1) % 4] - c[side];
  const Eigen::Vector2d outward = Eigen::Vector2d(along.y(), -along.x());
  const Eigen::Vector2d middle = c[side] + uniform(rng, 0.3, 0.7) * along + outward_share * outward;
  cv::circle(result.light,
             {static_cast<int>(std::lround(16 * middle.x())), static_cast<int>(std::lround(16 * middle.y()))},
             static_cast<int>(std::lround(2 * along.norm())), cv::Scalar(level), -1, cv::LINE_AA, 4);
  cv::GaussianBlur(result.light, result.light, {0, 0}, 0.6);
  return result;
}

void expect_found(const std::string& family, double outward_share, double level) {
  auto rng = test::test_rng();
  Detector detector(families({family}));
  constexpr int k_count = 48;
  int right = 0;
  for (int i = 0; i < k_count; ++i) {
    SCOPED_TRACE(i);
    const MarkerName name{family, std::to_string(i % 30)};
    const Spotted picture = spotted(name, static_cast<std::size_t>(i % 4), outward_share, level, rng);
    const cv::Mat grey = test::noisy_grey(picture.light, 2, rng);
    const auto found = detector.detect(grey);
    ASSERT_LE(found.size(), 1u);
    if (found.empty()) continue;
    ++right;
    EXPECT_EQ(found[0].marker, name);
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_TRUE(test::near(found[0].corners_px[k], picture.corners_px[k], 0.5));
  }
  EXPECT_GE(right, 0.9 * k_count);
}

TEST(BrokenSide, UnderABrightSpotIsReadWithA4x4Code) { expect_found("aruco_4x4_50", 0.02, 255); }
TEST(BrokenSide, UnderPaperIsReadWithA4x4Code) { expect_found("aruco_4x4_50", 0.02, 170); }
TEST(BrokenSide, BesideADarkSpotThatReachesBeyondThePaperIsReadWithA4x4Code) {
  expect_found("aruco_4x4_50", 0.07, 35);
}
TEST(BrokenSide, UnderASkinColouredSpotIsReadWithA4x4Code) { expect_found("aruco_4x4_50", 0.05, 110); }
TEST(BrokenSide, UnderABrightSpotIsReadWithApriltag16h5) { expect_found("apriltag_16h5", 0.02, 255); }

// The code needs every cell: a spot over a cell that turns it is no marker.
TEST(BrokenSide, WithAWrongCellIsNoMarker) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_50"}));
  for (int i = 0; i < 24; ++i) {
    const MarkerName name{"aruco_4x4_50", std::to_string(i)};
    const Spotted picture = spotted(name, static_cast<std::size_t>(i % 4), -0.12, 255, rng);
    for (const Detection& found : detector.detect(test::noisy_grey(picture.light, 2, rng)))
      EXPECT_EQ(found.marker, name);
  }
}

// Their black cells form figures whose outline breaks a code's border on one side, and its paper on another.
TEST(BrokenSide, IsNotSeenInMarkersInInvertedColours) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_50", "apriltag_16h5"}));
  for (int i = 0; i < 60; ++i) {
    const MarkerName name{i % 2 ? "apriltag_16h5_inverted" : "aruco_4x4_50_inverted", std::to_string(i / 2)};
    const PlacedMarker marker =
        test::placed(pinhole_vga(), name, {320, 240}, uniform(rng, 100, 200), uniform(rng, 0, 6.28),
                     uniform(rng, 0, 25_deg), uniform(rng, 0, 6.28));
    const auto light =
        test::light_of(pinhole_vga(), test::plain(640, 480, 70), std::vector{marker}, {.white = 170}, rng);
    for (const Detection& found : detector.detect(test::noisy_grey(light, 2, rng)))
      ADD_FAILURE() << found.marker.text() << " in " << name.text();
  }
}

TEST(BrokenSide, IsNotSeenInClutter) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_1000", "apriltag_16h5"}));
  for (int i = 0; i < 30; ++i) {
    const auto found = detector.detect(test::clutter(1280, 720, rng));
    EXPECT_TRUE(found.empty()) << found[0].marker.text();
  }
}

}  // namespace
}  // namespace limn::tracker
