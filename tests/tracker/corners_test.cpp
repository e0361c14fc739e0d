#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"

namespace limn::tracker {
namespace {

struct Sweep {
  double low_px, high_px, max_tilt;
  test::ImageOptions image;
  bool spin = true;
  Lens lens = pinhole_vga();
  bool give_lens = false;
  bool srgb_image = false;
  Encoding encoding = Encoding::linear;
  double bow = 0;        ///< bow of the upper and lower sides, as share of a side
  double motion_px = 0;  ///< uniform, in any direction
  double stains = 0;     ///< standard deviation of the light: spots some pixels wide on paper and ink
  int jpeg_quality = 0;  ///< 0: none
  bool pattern_fits = true;
};

cv::Mat in_motion(const cv::Mat& light, const Eigen::Vector2d& motion) {
  constexpr int k_shifts = 25;
  cv::Mat sum(light.size(), light.type(), cv::Scalar(0));
  for (int i = 0; i < k_shifts; ++i) {
    const Eigen::Vector2d d = (static_cast<double>(i) / (k_shifts - 1) - 0.5) * motion;
    cv::Mat shifted;
    cv::warpAffine(light, shifted, cv::Matx23d(1, 0, d.x(), 0, 1, d.y()), light.size(), cv::INTER_LINEAR,
                   cv::BORDER_REPLICATE);
    sum += shifted / k_shifts;
  }
  return sum;
}

// Light that differs from place to place, like that of a projector's image.
cv::Mat stained(const cv::Mat& light, double deviation, std::mt19937_64& rng) {
  constexpr double k_spot_px = 2;
  cv::Mat spots(light.size(), CV_32F);
  std::normal_distribution<float> level;
  for (int y = 0; y < spots.rows; ++y)
    for (int x = 0; x < spots.cols; ++x) spots.at<float>(y, x) = level(rng);
  cv::GaussianBlur(spots, spots, {0, 0}, k_spot_px);
  cv::Mat seen;
  cv::multiply(light, 1 + deviation * 2 * std::sqrt(std::numbers::pi) * k_spot_px * spots, seen);
  return seen;
}

cv::Mat after_jpeg(const cv::Mat& grey, int quality) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", grey, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
}

cv::Mat image_of(const Sweep& sweep, const PlacedMarker& marker, std::mt19937_64& rng) {
  const cv::Mat ground = test::plain(640, 480, 100);
  if (sweep.stains > 0) {
    cv::Mat light = test::light_of(sweep.lens, ground, std::vector{marker}, sweep.image, rng);
    light = stained(light, sweep.stains, rng);
    cv::GaussianBlur(light, light, {0, 0}, sweep.image.blur_px);
    return test::noisy_grey(light, sweep.image.noise_levels, rng);
  }
  if (sweep.motion_px == 0) return test::image_of(sweep.lens, ground, std::vector{marker}, sweep.image, rng);
  const double angle = uniform(rng, 0, 6.28);
  const cv::Mat light = test::light_of(sweep.lens, ground, std::vector{marker}, sweep.image, rng);
  return test::noisy_grey(
      in_motion(light, sweep.motion_px * Eigen::Vector2d(std::cos(angle), std::sin(angle))),
      sweep.image.noise_levels, rng);
}

// Encodes linear levels (0 ... 255).
cv::Mat srgb_encoded(cv::Mat grey) {
  for (int i = 0; i < grey.rows * grey.cols; ++i) {
    const double light = grey.data[i] / 255.0;
    const double encoded = light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
    grey.data[i] = static_cast<std::uint8_t>(std::lround(255 * encoded));
  }
  return grey;
}

struct SweepResult {
  int markers = 0, found = 0, wrong = 0, corners = 0;
  double rms_px = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double outward = 0;      ///< mean error away from the marker's centre
  double mahalanobis = 0;  ///< mean of e' C^-1 e / 2: 1 when the covariance is true
};

SweepResult swept(const Sweep& sweep, int count) {
  auto rng = test::test_rng();
  DetectorOptions options;
  options.encoding = sweep.encoding;
  options.pattern_fits = sweep.pattern_fits;
  Detector detector(families({"apriltag_36h11", "aruco_4x4_50"}), options);
  SweepResult result;
  double squares = 0;
  for (int i = 0; i < count; ++i) {
    const MarkerName name{i % 2 ? "apriltag_36h11" : "aruco_4x4_50", std::to_string(i % 50)};
    PlacedMarker marker =
        test::placed(sweep.lens, name, {uniform(rng, 120, 520), uniform(rng, 120, 360)},
                     uniform(rng, sweep.low_px, sweep.high_px), sweep.spin ? uniform(rng, 0, 6.28) : 0,
                     uniform(rng, 0, sweep.max_tilt), uniform(rng, 0, 6.28));
    marker.bow = sweep.bow;
    cv::Mat grey = image_of(sweep, marker, rng);
    if (sweep.srgb_image) grey = srgb_encoded(grey);
    if (sweep.jpeg_quality > 0) grey = after_jpeg(grey, sweep.jpeg_quality);
    const auto truth = test::true_corners(sweep.lens, marker);
    ++result.markers;
    for (const Detection& found : detector.detect(grey, sweep.give_lens ? &sweep.lens : nullptr)) {
      if (found.marker != name || (found.corners_px[0] - truth[0]).norm() > 5) {
        ++result.wrong;
        continue;
      }
      ++result.found;
      const Eigen::Vector2d centre = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d e = found.corners_px[k] - truth[k];
        squares += e.squaredNorm();
        result.mean += e;
        result.outward += e.dot((truth[k] - centre).normalized());
        result.mahalanobis += 0.5 * e.dot(found.corner_covariance[k].inverse() * e);
        ++result.corners;
      }
    }
  }
  result.rms_px = std::sqrt(squares / result.corners);
  result.mean /= result.corners;
  result.outward /= result.corners;
  result.mahalanobis /= result.corners;
  return result;
}

TEST(Detector, FindsSharpMarkersToATwentiethOfAPixelWithoutBias) {
  Sweep sweep{48, 120, 70_deg, {}};
  sweep.image.noise_levels = 2;
  const SweepResult r = swept(sweep, 60);
  EXPECT_EQ(r.found, r.markers);
  EXPECT_EQ(r.wrong, 0);
  EXPECT_LT(r.rms_px, 0.08);
  EXPECT_LT(r.mean.norm(), 0.012);
  EXPECT_LT(std::abs(r.outward), 0.012);
}

TEST(Detector, HasNoBiasWhereSidesRunAlongThePixels) {
  Sweep sweep{48, 120, 0, {}};
  sweep.spin = false;
  sweep.image.noise_levels = 2;
  const SweepResult r = swept(sweep, 40);
  EXPECT_EQ(r.found, r.markers);
  EXPECT_LT(r.rms_px, 0.08);
  EXPECT_LT(r.mean.norm(), 0.015);
  EXPECT_LT(std::abs(r.outward), 0.015);
}

// Pixels on such sides are half black and half white, so noise decides: a ragged boundary, half as long
// again.
TEST(Detector, FindsMarkersWhoseSidesRunThroughPixelCentres) {
  std::mt19937_64 rng = test::test_rng();
  const Lens lens = pinhole_vga();
  Detector detector(families({"aruco_4x4_50"}), {.broken_markers = false});
  constexpr int k_images = 20;
  int found = 0;
  for (int i = 0; i < k_images; ++i) {
    const std::vector<PlacedMarker> markers = {
        test::placed(lens, {"aruco_4x4_50", "7"}, {150, 240}, 120, 0, 0, 0),
        test::placed(lens, {"aruco_4x4_50", "9"}, {450, 240}, 60, 0, 0, 0)};
    const cv::Mat grey =
        test::image_of(lens, test::plain(640, 480, 100), markers, {.blur_px = 0.7, .noise_levels = 2}, rng);
    found += static_cast<int>(detector.detect(grey).size());
  }
  EXPECT_EQ(found, 2 * k_images);
}

TEST(Detector, HasNoBiasInImagesOfAnSrgbCameraWhenToldSo) {
  Sweep sweep{48, 120, 45_deg, {}};
  sweep.image.blur_px = 0.7;
  sweep.image.noise_levels = 1;
  sweep.srgb_image = true;
  const SweepResult uncorrected = swept(sweep, 40);
  sweep.encoding = Encoding::srgb;
  const SweepResult corrected = swept(sweep, 40);
  EXPECT_EQ(corrected.found, corrected.markers);
  EXPECT_LT(std::abs(corrected.outward), 0.012);
  EXPECT_GT(uncorrected.outward, -0.04);  // .06 without the correction by the cells' edges (edge_bleed.h)
  EXPECT_LT(uncorrected.outward, -0.012);
}

TEST(Detector, FindsSmallMarkers) {
  Sweep sweep{16, 32, 45_deg, {}};
  sweep.image.noise_levels = 2;
  sweep.image.blur_px = 0.4;
  const SweepResult r = swept(sweep, 60);
  EXPECT_GE(r.found, 58);
  EXPECT_EQ(r.wrong, 0);
  EXPECT_LT(r.rms_px, 0.15);
}

TEST(Detector, StraightensTheSidesOfADistortedPictureThroughItsLens) {
  Sweep sweep{120, 200, 45_deg, {}};
  sweep.lens = bent_vga();
  sweep.image.blur_px = 0.5;
  sweep.image.noise_levels = 1;
  const SweepResult without = swept(sweep, 30);
  sweep.give_lens = true;
  const SweepResult with = swept(sweep, 30);
  EXPECT_GE(with.found, 28);
  EXPECT_LT(with.rms_px, 0.05);
  EXPECT_LT(std::abs(with.outward), 0.01);
  EXPECT_GT(without.rms_px, 1.4 * with.rms_px);  // bent lines follow most of the bow
}

// Normalised errors are N(0, 1) within a fifth.
void expect_true_covariance(const SweepResult& r) {
  EXPECT_GE(r.found, r.markers - 2);
  EXPECT_GT(r.mahalanobis, 0.8 * 0.8);
  EXPECT_LT(r.mahalanobis, 1.2 * 1.2);
}

TEST(Detector, SaysHowSureItsCornersAre) {
  for (const double noise : {2.0, 8.0}) {
    SCOPED_TRACE(noise);
    Sweep sweep{60, 120, 50_deg, {}};
    sweep.image.blur_px = 0.7;
    sweep.image.noise_levels = noise;
    expect_true_covariance(swept(sweep, 60));
  }
}

TEST(Detector, SaysHowSureItsCornersAreWithoutAnyBlur) {
  Sweep sweep{48, 120, 60_deg, {}};
  sweep.image.noise_levels = 2;
  const SweepResult r = swept(sweep, 60);
  expect_true_covariance(r);
  EXPECT_LT(r.rms_px, 0.02);
}

// Where sides end at pixel borders no crossing has an error: the correlation of the residuals is 0 / 0.
TEST(Detector, SaysHowSureItsCornersAreInAPerfectImage) {
  auto rng = test::test_rng();
  const cv::Mat white(480, 640, CV_8UC1, cv::Scalar(210));
  for (const double side : {24, 60, 200}) {
    const PlacedMarker marker =
        test::placed(pinhole_vga(), {"aruco_4x4_50", "7"}, {319.5, 239.5}, side, 0, 0, 0);
    const auto found = Detector(families({"aruco_4x4_50"}))
                           .detect(test::image_of(pinhole_vga(), white, std::span(&marker, 1), {}, rng));
    ASSERT_EQ(found.size(), 1u) << side;
    for (const Eigen::Matrix2d& covariance : found[0].corner_covariance) {
      EXPECT_TRUE(covariance.allFinite()) << side;
      EXPECT_GT(covariance.determinant(), 0) << side;
    }
  }
}

TEST(Detector, SaysHowSureItsCornersAreInUnevenLight) {
  Sweep sweep{60, 120, 50_deg, {}};
  sweep.image.blur_px = 0.7;
  sweep.image.noise_levels = 2;
  sweep.stains = 0.05;
  expect_true_covariance(swept(sweep, 60));
}

TEST(Detector, SaysHowSureItsCornersAreInAJpegImage) {
  Sweep sweep{60, 120, 50_deg, {}};
  sweep.image.blur_px = 0.4;
  sweep.image.noise_levels = 2;
  sweep.jpeg_quality = 75;
  expect_true_covariance(swept(sweep, 60));
}

TEST(Detector, FindsMovingCornersAndSaysHowSureTheyAre) {
  for (const double motion : {12.0, 16.0}) {
    Sweep sweep{60, 120, 45_deg, {}};
    sweep.image.noise_levels = 2;
    sweep.motion_px = motion;
    const SweepResult r = swept(sweep, 30);
    EXPECT_GE(r.found, 20) << motion;  // whether cells can be read is tested elsewhere
    EXPECT_EQ(r.wrong, 0);
    EXPECT_LT(r.rms_px, 0.1) << motion;
    EXPECT_LT(r.mean.norm(), 0.02) << motion;
    EXPECT_GT(r.mahalanobis, 0.6) << motion;
    EXPECT_LT(r.mahalanobis, 2) << motion;
  }
}

TEST(Detector, SaysHowSureTheCornersOfSmallMarkersAre) {
  Sweep sweep{16, 32, 40_deg, {}};
  sweep.image.blur_px = 0.4;
  sweep.image.noise_levels = 2;
  const SweepResult r = swept(sweep, 80);
  EXPECT_GE(r.found, 78);
  EXPECT_LT(r.rms_px, 0.035);
  EXPECT_GT(r.mahalanobis, 0.6);
  EXPECT_LT(r.mahalanobis, 1.6);
}

TEST(Detector, SaysHowSureTheCornersOfBlurredMarkersAre) {
  for (const double blur : {2.5, 3.5}) {
    Sweep sweep{60, 120, 45_deg, {}};
    sweep.image.blur_px = blur;
    sweep.image.noise_levels = 2;
    const SweepResult r = swept(sweep, 40);
    EXPECT_EQ(r.found, r.markers);
    EXPECT_LT(r.rms_px, 0.08) << blur;
    EXPECT_GT(r.mahalanobis, 0.5) << blur;
    EXPECT_LT(r.mahalanobis, 2) << blur;
  }
}

TEST(Detector, SaysHowSureCornersAreByTheirSidesAlone) {
  Sweep sweep{16, 40, 40_deg, {}};
  sweep.image.blur_px = 1;
  sweep.image.noise_levels = 2;
  const SweepResult fitted = swept(sweep, 80);
  sweep.pattern_fits = false;
  const SweepResult r = swept(sweep, 80);
  EXPECT_EQ(r.found, fitted.found);
  EXPECT_GT(r.rms_px, 1.5 * fitted.rms_px);
  EXPECT_LT(r.rms_px, 0.3);
  // It may be much less: the enlarged covariance is made for blurs three times as wide.
  EXPECT_LT(r.mahalanobis, 1.5);
}

TEST(Detector, FindsTheCornersOfBlurredMarkersThroughTheLens) {
  Sweep sweep{120, 180, 45_deg, {}};
  sweep.lens = bent_vga();
  sweep.give_lens = true;
  sweep.image.blur_px = 3;
  sweep.image.noise_levels = 2;
  const SweepResult r = swept(sweep, 40);
  EXPECT_EQ(r.found, r.markers);
  EXPECT_LT(r.rms_px, 0.08);  // twice as much where patterns are fitted without the lens
  expect_true_covariance(r);
}

TEST(Detector, FindsTheCornersOfBentPaper) {
  for (const double bow : {0.003, 0.006, 0.012}) {  // 0.2 to 1 px
    SCOPED_TRACE(bow);
    Sweep sweep{60, 80, 30_deg, {}};
    sweep.image.blur_px = 0.5;
    sweep.image.noise_levels = 2;
    sweep.bow = bow;
    const SweepResult r = swept(sweep, 25);
    EXPECT_EQ(r.found, r.markers);
    EXPECT_LT(r.rms_px, 0.07) << bow;  // 0.15 and more with straight lines
    expect_true_covariance(r);
  }
}

TEST(Detector, MovesACornerSteadilyAsItsPaperBends) {
  Detector detector(families({"aruco_4x4_50"}));
  PlacedMarker marker = test::placed(pinhole_vga(), {"aruco_4x4_50", "3"}, {320.3, 240.1}, 60, 0.3, 0.2, 1);
  test::ImageOptions options;
  options.blur_px = 1;
  options.noise_levels = 4;
  constexpr double k_step_px = 0.05;
  std::array<Eigen::Vector2d, 4> before;
  for (int step = 0; step <= 50; ++step) {  // up to 2.5 px: beyond the largest bow that is accepted
    marker.bow = k_step_px * step / 60;
    std::mt19937_64 rng(7);  // the same noise in all images
    const auto found = detector.detect(
        test::image_of(pinhole_vga(), test::plain(640, 480, 100), std::vector{marker}, options, rng));
    ASSERT_EQ(found.size(), 1u);
    for (std::size_t k = 0; k < 4 && step > 0; ++k)
      EXPECT_LT((found[0].corners_px[k] - before[k]).norm(), 5 * k_step_px) << step << " corner " << k;
    before = found[0].corners_px;
  }
}

TEST(Detector, HasNoBiasWhereTheWhiteMarginIsAPixelWide) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_50"}));
  double outward = 0;
  constexpr int k_count = 15;
  for (int i = 0; i < k_count; ++i) {
    PlacedMarker marker = test::placed(pinhole_vga(), {"aruco_4x4_50", std::to_string(i)}, {320, 240},
                                       uniform(rng, 60, 120), uniform(rng, 0, 6.28), 20_deg, i);
    marker.margin = 0.015;
    const auto truth = test::true_corners(pinhole_vga(), marker);
    const auto found =
        detector.detect(test::image_of(pinhole_vga(), test::plain(640, 480, 90), std::vector{marker},
                                       {.blur_px = 0.5, .noise_levels = 2}, rng));
    ASSERT_EQ(found.size(), 1u) << i;
    const Eigen::Vector2d centre = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_TRUE(test::near(found[0].corners_px[k], truth[k], 0.2));
      outward += (found[0].corners_px[k] - truth[k]).dot((truth[k] - centre).normalized()) / (4 * k_count);
    }
  }
  EXPECT_LT(std::abs(outward), 0.02);  // 0.1 and more with edge lines only
}

}  // namespace
}  // namespace limn::tracker
