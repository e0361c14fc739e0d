#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"

namespace limn::tracker {
namespace {

// Strips of shadow, 4:1. One of them begins on the paper beside the ink: `angle` away from one of the
// marker's sides, `beside_px` from the side's middle.
cv::Mat with_slats(const cv::Mat& light,
                   const std::array<Eigen::Vector2d, 4>& corners,
                   std::size_t side,
                   double beside_px,
                   double angle) {
  constexpr double k_strip_px = 17;
  constexpr double k_penumbra_px = 2;
  const Eigen::Vector2d run = (corners[(side + 1) % 4] - corners[side]).normalized();
  const Eigen::Vector2d inward = Eigen::Rotation2Dd(angle) * Eigen::Vector2d(-run.y(), run.x());
  const Eigen::Vector2d middle = 0.5 * (corners[side] + corners[(side + 1) % 4]);
  cv::Mat lit = light.clone();
  for (int y = 0; y < lit.rows; ++y)
    for (int x = 0; x < lit.cols; ++x) {
      const double in = inward.dot(Eigen::Vector2d(x, y) - middle) + beside_px;
      const double wave = std::abs(std::remainder(in - 0.5 * k_strip_px, 2 * k_strip_px)) - 0.5 * k_strip_px;
      lit.at<float>(y, x) *=
          static_cast<float>(0.25 + 0.75 * std::clamp(0.5 + wave / k_penumbra_px, 0.0, 1.0));
    }
  return lit;
}

void expect_no_shadows_edge(const Lens& lens, double low_px, double high_px, double most_pull) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  constexpr int k_count = 40;
  double squares = 0;
  int near = 0;
  int corners = 0;
  for (int i = 0; i < k_count; ++i) {
    const PlacedMarker marker = test::placed(lens, {"apriltag_36h11", std::to_string(i)}, {320, 240},
                                             uniform(rng, low_px, high_px), uniform(rng, 0, 6.28), 20_deg, i);
    const auto truth = test::true_corners(lens, marker);
    const cv::Mat light = test::light_of(lens, test::plain(640, 480, 90), std::vector{marker}, {}, rng);
    const cv::Mat lit = with_slats(light, truth, static_cast<std::size_t>(i % 4), uniform(rng, 2.5, 7),
                                   uniform(rng, -2_deg, 2_deg));
    for (const Detection& found : detector.detect(test::noisy_grey(lit, 2, rng), &lens)) {
      ASSERT_EQ(found.marker, marker.marker);
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d e = found.corners_px[k] - truth[k];
        squares += 0.5 * e.dot(found.corner_covariance[k].inverse() * e);
        near += e.norm() < 0.5;
        ++corners;
      }
    }
  }
  EXPECT_GE(corners, 4 * 0.75 * k_count);
  EXPECT_GE(near, 0.9 * corners);                      // half without the search for shadows
  EXPECT_LT(std::sqrt(squares / corners), most_pull);  // a hundred without it
}

TEST(Detector, TakesNoShadowsEdgeForTheInks) { expect_no_shadows_edge(pinhole_vga(), 70, 120, 1.2); }
TEST(Detector, TakesNoShadowsEdgeForTheInksThroughALens) { expect_no_shadows_edge(bent_vga(), 120, 160, 2); }

// The known light of a marker is not used any more when a shadow has come.
TEST(Detector, SeesAShadowComeUponAMarkerThatItFollows) {
  auto rng = test::test_rng();
  const Lens lens = pinhole_vga();
  Detector detector(families({"apriltag_36h11"}));
  constexpr int k_count = 20;
  int kept = 0, near = 0, corners = 0;
  for (int i = 0; i < k_count; ++i) {
    const PlacedMarker marker = test::placed(lens, {"apriltag_36h11", std::to_string(i)}, {320, 240},
                                             uniform(rng, 70, 120), uniform(rng, 0, 6.28), 20_deg, i);
    const auto truth = test::true_corners(lens, marker);
    const cv::Mat light = test::light_of(lens, test::plain(640, 480, 90), std::vector{marker}, {}, rng);
    const cv::Mat slats = with_slats(light, truth, static_cast<std::size_t>(i % 4), uniform(rng, 2.5, 7),
                                     uniform(rng, -2_deg, 2_deg));
    const auto first = detector.detect(test::noisy_grey(light, 2, rng), &lens);
    std::vector<Detection> unchanged, shaded;
    detector.follow(test::noisy_grey(light, 2, rng), &lens, first, &unchanged);
    ASSERT_EQ(unchanged.size(), 1u) << i;
    kept += unchanged[0].unshadowed && unchanged[0].unshadowed->age == 1;
    detector.follow(test::noisy_grey(slats, 2, rng), &lens, unchanged, &shaded);
    for (const Detection& found : shaded)
      for (std::size_t k = 0; k < 4; ++k, ++corners) near += (found.corners_px[k] - truth[k]).norm() < 0.5;
  }
  EXPECT_GE(kept, 0.9 * k_count);  // in unchanged light
  EXPECT_GE(corners, 4 * 0.75 * k_count);
  EXPECT_GE(near, 0.9 * corners);
}

}  // namespace
}  // namespace limn::tracker
