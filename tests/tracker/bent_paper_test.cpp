#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"

// Markers on paper that is wrapped around a cylinder.
namespace limn::tracker {
namespace {

struct Wrapped {
  int markers = 0, found = 0;
  std::vector<double> normalised;  // errors of the corners, in stated standard deviations
  std::vector<double> error_px;

  double share_within(double deviations) const {
    return static_cast<double>(std::ranges::count_if(normalised, [&](double e) { return e < deviations; })) /
           static_cast<double>(normalised.size());
  }
};

Wrapped wrapped(double radius, double low_px, double high_px, int count) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_50", "apriltag_36h11"}));
  Wrapped result;
  for (int i = 0; i < count; ++i) {
    const MarkerName name{i % 3 ? "aruco_4x4_50" : "apriltag_36h11", std::to_string(i % 50)};
    PlacedMarker marker = test::placed(pinhole_vga(), name, {uniform(rng, 260, 380), uniform(rng, 200, 280)},
                                       uniform(rng, low_px, high_px), uniform(rng, 0, 6.28),
                                       uniform(rng, 0, 45_deg), uniform(rng, 0, 6.28));
    marker.cylinder_radius = radius;
    const auto truth = test::true_corners(pinhole_vga(), marker);
    const cv::Mat grey = test::image_of(pinhole_vga(), test::plain(640, 480, 100), std::vector{marker},
                                        {.blur_px = 0.6, .noise_levels = 2}, rng);
    ++result.markers;
    for (const Detection& found : detector.detect(grey)) {
      EXPECT_EQ(found.marker, name);
      ++result.found;
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d e = found.corners_px[k] - truth[k];
        result.error_px.push_back(e.norm());
        result.normalised.push_back(std::sqrt(e.dot(found.corner_covariance[k].inverse() * e)));
      }
    }
  }
  std::ranges::sort(result.error_px);
  return result;
}

// 95 % of a plane's Gaussian lie within 2.45 deviations, 98.9 % within 3.
void expect_honest(const Wrapped& paper) {
  EXPECT_GT(paper.share_within(2.45), 0.88);
  EXPECT_GT(paper.share_within(3), 0.95);
  EXPECT_GE(paper.share_within(6), 0.99);
}

TEST(BentPaper, AroundALargeCylinderHasItsCornersWhereTheSidesMeet) {
  const Wrapped paper = wrapped(4, 60, 160, 60);
  EXPECT_GE(paper.found, paper.markers - 1);
  EXPECT_LT(paper.error_px[paper.error_px.size() / 2], 0.06);
  expect_honest(paper);
}

TEST(BentPaper, AroundACylinderOfTwoSidesHasHonestCorners) {
  const Wrapped paper = wrapped(2, 60, 160, 80);
  EXPECT_GE(paper.found, 0.95 * paper.markers);
  EXPECT_LT(paper.error_px[paper.error_px.size() / 2], 0.1);
  expect_honest(paper);
}

TEST(BentPaper, AroundACylinderOfOneSideHasNearlyHonestCorners) {
  const Wrapped paper = wrapped(1, 60, 160, 100);
  EXPECT_GE(paper.found, 0.6 * paper.markers);
  EXPECT_LT(paper.error_px[paper.error_px.size() / 2], 0.15);
  EXPECT_GT(paper.share_within(2.45), 0.85);
  EXPECT_GT(paper.share_within(3), 0.9);
  EXPECT_GT(paper.share_within(6), 0.97);
}

// What limits it: where the middles of the sides lie half a cell from straight ones, only a rough fit is
// read.
TEST(BentPaper, AroundACylinderOfLessThanASideHasMostCornersWithinTheirDeviations) {
  const Wrapped paper = wrapped(0.8, 80, 200, 80);
  EXPECT_GE(paper.found, 0.4 * paper.markers);
  EXPECT_GT(paper.share_within(3), 0.72);
  EXPECT_GT(paper.share_within(6), 0.88);
}

}  // namespace
}  // namespace limn::tracker
