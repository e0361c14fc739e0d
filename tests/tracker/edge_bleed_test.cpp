#include "tracker/edge_bleed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "tests/support/matchers.h"
#include "tests/tracker/marker_images.h"
#include "tracker/detector.h"
#include "tracker/refine.h"

namespace limn::tracker {
namespace {

using Camera = std::function<cv::Mat(cv::Mat light)>;  // turns light, 0 ... 255, into grey levels

cv::Mat srgb_encoded(cv::Mat light) {
  light.forEach<float>([](float& level, const int*) {
    const double l = std::max(0.0, level / 255.0);
    level = static_cast<float>(255 * (l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055));
  });
  return light;
}

cv::Mat overexposed(cv::Mat light) { return cv::min(1.8 * light, 255); }

cv::Mat sharpened(cv::Mat light) {
  cv::Mat blurred;
  cv::GaussianBlur(light, blurred, {}, 1.2);
  return 1.2 * light - 0.2 * blurred;  // no level is clipped at black or white
}

struct Outward {
  double by_sides = 0, by_detector = 0;  // px, mean of all corners
};

// For the corners of twelve markers in two images.
Outward outward(const Camera& camera) {
  auto rng = test::test_rng();
  const Lens lens = Lens::pinhole(600, 600, 319.5, 239.5);
  Detector detector(Families::load(std::vector<std::string>{"apriltag_36h11"}).value());
  EdgeRefiner refiner;
  Outward sum;
  int corners = 0;
  for (int image = 0; image < 2; ++image) {
    std::vector<test::PlacedMarker> markers;
    for (int i = 0; i < 6; ++i)
      markers.push_back(test::placed(lens, {"apriltag_36h11", std::to_string(6 * image + i)},
                                     {130.0 + 190 * (i % 3), 140.0 + 200 * (i / 3)}, 80 + 8 * i, 0.3 + i, 0.4,
                                     1.1 * i));
    const cv::Mat paper = test::plain(640, 480, 130);
    cv::Mat light = test::light_of(lens, paper, markers, {.black = 20, .white = 180}, rng);
    cv::GaussianBlur(light, light, {}, 0.8);
    const cv::Mat grey = test::noisy_grey(camera(light), 1.5, rng);
    const auto found = detector.detect(grey);
    EXPECT_EQ(found.size(), markers.size());
    for (const test::PlacedMarker& marker : markers) {
      const auto truth = test::true_corners(lens, marker);
      const Eigen::Vector2d middle = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
      const auto sides = refiner.refine(grey, {truth, 3}, 10, nullptr);
      const auto hit = std::find_if(found.begin(), found.end(),
                                    [&](const Detection& d) { return d.marker == marker.marker; });
      if (!sides || hit == found.end()) {
        ADD_FAILURE() << marker.marker.id << " is missing";
        continue;
      }
      for (std::size_t k = 0; k < 4; ++k, ++corners) {
        const Eigen::Vector2d out = (truth[k] - middle).normalized();
        sum.by_sides += out.dot(sides->corners_px[k] - truth[k]);
        sum.by_detector += out.dot(hit->corners_px[k] - truth[k]);
      }
    }
  }
  return {sum.by_sides / corners, sum.by_detector / corners};
}

void expect_most_undone(const Camera& camera) {
  const auto [by_sides, by_detector] = outward(camera);
  EXPECT_LT(by_sides, -0.08);
  EXPECT_LT(std::abs(by_detector), 0.35 * std::abs(by_sides));
}

TEST(EdgeBleed, IsUndoneWhereLevelsAreNoLight) { expect_most_undone(srgb_encoded); }

TEST(EdgeBleed, IsUndoneWherePaperIsOverexposed) { expect_most_undone(overexposed); }

TEST(EdgeBleed, IsNoneInLightAsItIs) {
  EXPECT_LT(std::abs(outward([](cv::Mat light) { return light; }).by_detector), 0.006);
  EXPECT_LT(std::abs(outward(sharpened).by_detector), 0.006);
}

TEST(EdgeBleed, OfMarkersThatDisagreeIsUnsure) {
  const EdgeBleed one{0.2, 0.0004}, other{0.0, 0.0004};
  const auto alike = common_edge_bleed(std::vector{one, one});
  const auto unlike = common_edge_bleed(std::vector{one, other});
  EXPECT_NEAR(alike->px, 0.2, 1e-12);
  EXPECT_NEAR(unlike->px, 0.1, 1e-12);
  EXPECT_GT(unlike->variance, 10 * alike->variance);
  EXPECT_FALSE(common_edge_bleed({}));
}

TEST(EdgeBleed, MovesAllSidesOutByWhatIsSureOfIt) {
  const std::array<Eigen::Vector2d, 4> square{Eigen::Vector2d(10, 10), {50, 10}, {50, 40}, {10, 40}};
  std::array<Eigen::Matrix2d, 4> covariance;
  covariance.fill(Eigen::Matrix2d::Zero());
  auto corners = square;
  undo_edge_bleed({0.2, 1e-8}, &corners, &covariance);
  EXPECT_TRUE(test::near(corners[0], Eigen::Vector2d(9.8, 9.8), 1e-4));
  EXPECT_TRUE(test::near(corners[2], Eigen::Vector2d(50.2, 40.2), 1e-4));
  // It treats no more than four fifths of the bleed as certain.
  EXPECT_NEAR(std::sqrt(covariance[1].trace() / 2), 0.04, 0.01);
  corners = square;
  undo_edge_bleed({0.2, 0.01}, &corners, &covariance);  // two standard deviations
  EXPECT_EQ(corners[0], square[0]);
  undo_edge_bleed({std::nan(""), 0.01}, &corners, &covariance);
  EXPECT_EQ(corners[0], square[0]);
}

}  // namespace
}  // namespace limn::tracker
