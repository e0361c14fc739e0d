#include "tracker/detector.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/tracker/marker_pictures.h"

namespace limn::tracker {
namespace {

using namespace test::literals;
using test::PlacedMarker;

Families families(const std::vector<std::string>& names) { return Families::load(names).value(); }

double uniform(std::mt19937_64& rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(rng);
}

Lens pinhole_vga() { return Lens::pinhole(600, 600, 319.5, 239.5); }
Lens bent_vga() {
  return Lens::create("LENSMODEL_OPENCV8", {500, 500, 319.5, 239.5, -0.25, 0.08, 1e-3, -1e-3, 0, 0, 0, 0})
      .value();
}

struct Sweep {
  double low_px, high_px, max_tilt;
  test::PictureOptions picture;
  bool spin = true;
  Lens lens = pinhole_vga();
  bool give_lens = false;
  bool srgb_picture = false;
  Encoding encoding = Encoding::linear;
  double bow = 0;        ///< of the upper and lower sides, as share of a side
  double motion_px = 0;  ///< even, in any direction
  double stains = 0;     ///< of the light, standard deviation: spots some pixels wide on paper and ink
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

// Light that differs from place to place, as that of a projector's picture does.
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

cv::Mat picture_of(const Sweep& sweep, const PlacedMarker& marker, std::mt19937_64& rng) {
  const cv::Mat ground = test::plain(640, 480, 100);
  if (sweep.stains > 0) {
    cv::Mat light = test::light_of(sweep.lens, ground, std::vector{marker}, sweep.picture, rng);
    light = stained(light, sweep.stains, rng);
    cv::GaussianBlur(light, light, {0, 0}, sweep.picture.blur_px);
    return test::noisy_grey(light, sweep.picture.noise_levels, rng);
  }
  if (sweep.motion_px == 0)
    return test::picture_of(sweep.lens, ground, std::vector{marker}, sweep.picture, rng);
  const double angle = uniform(rng, 0, 6.28);
  const cv::Mat light = test::light_of(sweep.lens, ground, std::vector{marker}, sweep.picture, rng);
  return test::noisy_grey(
      in_motion(light, sweep.motion_px * Eigen::Vector2d(std::cos(angle), std::sin(angle))),
      sweep.picture.noise_levels, rng);
}

// Of linear levels (0 ... 255).
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
    cv::Mat grey = picture_of(sweep, marker, rng);
    if (sweep.srgb_picture) grey = srgb_encoded(grey);
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
  sweep.picture.noise_levels = 2;
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
  sweep.picture.noise_levels = 2;
  const SweepResult r = swept(sweep, 40);
  EXPECT_EQ(r.found, r.markers);
  EXPECT_LT(r.rms_px, 0.08);
  EXPECT_LT(r.mean.norm(), 0.015);
  EXPECT_LT(std::abs(r.outward), 0.015);
}

// Pixels on such sides are half black, half white, and noise decides: a ragged boundary, half as long again.
TEST(Detector, FindsMarkersWhoseSidesRunThroughPixelCentres) {
  std::mt19937_64 rng = test::test_rng();
  const Lens lens = pinhole_vga();
  Detector detector(families({"aruco_4x4_50"}), {.broken_markers = false});
  constexpr int k_pictures = 20;
  int found = 0;
  for (int i = 0; i < k_pictures; ++i) {
    const std::vector<PlacedMarker> markers = {
        test::placed(lens, {"aruco_4x4_50", "7"}, {150, 240}, 120, 0, 0, 0),
        test::placed(lens, {"aruco_4x4_50", "9"}, {450, 240}, 60, 0, 0, 0)};
    const cv::Mat grey =
        test::picture_of(lens, test::plain(640, 480, 100), markers, {.blur_px = 0.7, .noise_levels = 2}, rng);
    found += static_cast<int>(detector.detect(grey).size());
  }
  EXPECT_EQ(found, 2 * k_pictures);
}

TEST(Detector, HasNoBiasInPicturesOfAnSrgbCameraWhenToldSo) {
  Sweep sweep{48, 120, 45_deg, {}};
  sweep.picture.blur_px = 0.7;
  sweep.picture.noise_levels = 1;
  sweep.srgb_picture = true;
  const SweepResult untold = swept(sweep, 40);
  sweep.encoding = Encoding::srgb;
  const SweepResult told = swept(sweep, 40);
  EXPECT_EQ(told.found, told.markers);
  EXPECT_LT(std::abs(told.outward), 0.012);
  EXPECT_GT(untold.outward, -0.04);  // .06 without what the cells' own edges say (ink_retreat.h)
  EXPECT_LT(untold.outward, -0.012);
}

TEST(Detector, FindsSmallMarkers) {
  Sweep sweep{16, 32, 45_deg, {}};
  sweep.picture.noise_levels = 2;
  sweep.picture.blur_px = 0.4;
  const SweepResult r = swept(sweep, 60);
  EXPECT_GE(r.found, 58);
  EXPECT_EQ(r.wrong, 0);
  EXPECT_LT(r.rms_px, 0.15);
}

TEST(Detector, StraightensTheSidesOfADistortedPictureThroughItsLens) {
  Sweep sweep{120, 200, 45_deg, {}};
  sweep.lens = bent_vga();
  sweep.picture.blur_px = 0.5;
  sweep.picture.noise_levels = 1;
  const SweepResult without = swept(sweep, 30);
  sweep.give_lens = true;
  const SweepResult with = swept(sweep, 30);
  EXPECT_GE(with.found, 28);
  EXPECT_LT(with.rms_px, 0.05);
  EXPECT_LT(std::abs(with.outward), 0.01);
  EXPECT_GT(without.rms_px, 1.4 * with.rms_px);  // bent lines follow most of the bow
}

// Pulls of N(0, 1) within a fifth.
void expect_true_covariance(const SweepResult& r) {
  EXPECT_GE(r.found, r.markers - 2);
  EXPECT_GT(r.mahalanobis, 0.8 * 0.8);
  EXPECT_LT(r.mahalanobis, 1.2 * 1.2);
}

TEST(Detector, SaysHowSureItsCornersAre) {
  for (const double noise : {2.0, 8.0}) {
    SCOPED_TRACE(noise);
    Sweep sweep{60, 120, 50_deg, {}};
    sweep.picture.blur_px = 0.7;
    sweep.picture.noise_levels = noise;
    expect_true_covariance(swept(sweep, 60));
  }
}

TEST(Detector, SaysHowSureItsCornersAreWithoutAnyBlur) {
  Sweep sweep{48, 120, 60_deg, {}};
  sweep.picture.noise_levels = 2;
  const SweepResult r = swept(sweep, 60);
  expect_true_covariance(r);
  EXPECT_LT(r.rms_px, 0.02);
}

// Of sides that end where pixels do, no crossing errs: what is computed from residuals is 0 of 0.
TEST(Detector, SaysHowSureItsCornersAreInAPerfectPicture) {
  auto rng = test::test_rng();
  const cv::Mat white(480, 640, CV_8UC1, cv::Scalar(210));
  for (const double side : {24, 60, 200}) {
    const PlacedMarker marker =
        test::placed(pinhole_vga(), {"aruco_4x4_50", "7"}, {319.5, 239.5}, side, 0, 0, 0);
    const auto found = Detector(families({"aruco_4x4_50"}))
                           .detect(test::picture_of(pinhole_vga(), white, std::span(&marker, 1), {}, rng));
    ASSERT_EQ(found.size(), 1u) << side;
    for (const Eigen::Matrix2d& covariance : found[0].corner_covariance) {
      EXPECT_TRUE(covariance.allFinite()) << side;
      EXPECT_GT(covariance.determinant(), 0) << side;
    }
  }
}

TEST(Detector, SaysHowSureItsCornersAreInUnevenLight) {
  Sweep sweep{60, 120, 50_deg, {}};
  sweep.picture.blur_px = 0.7;
  sweep.picture.noise_levels = 2;
  sweep.stains = 0.05;
  expect_true_covariance(swept(sweep, 60));
}

TEST(Detector, SaysHowSureItsCornersAreInAJpegPicture) {
  Sweep sweep{60, 120, 50_deg, {}};
  sweep.picture.blur_px = 0.4;
  sweep.picture.noise_levels = 2;
  sweep.jpeg_quality = 75;
  expect_true_covariance(swept(sweep, 60));
}

TEST(Detector, FindsMovingCornersAndSaysHowSureTheyAre) {
  for (const double motion : {12.0, 16.0}) {
    Sweep sweep{60, 120, 45_deg, {}};
    sweep.picture.noise_levels = 2;
    sweep.motion_px = motion;
    const SweepResult r = swept(sweep, 30);
    EXPECT_GE(r.found, 20) << motion;  // reading the cells is another matter
    EXPECT_EQ(r.wrong, 0);
    EXPECT_LT(r.rms_px, 0.1) << motion;
    EXPECT_LT(r.mean.norm(), 0.02) << motion;
    EXPECT_GT(r.mahalanobis, 0.6) << motion;
    EXPECT_LT(r.mahalanobis, 2) << motion;
  }
}

TEST(Detector, SaysHowSureTheCornersOfSmallMarkersAre) {
  Sweep sweep{16, 32, 40_deg, {}};
  sweep.picture.blur_px = 0.4;
  sweep.picture.noise_levels = 2;
  const SweepResult r = swept(sweep, 80);
  EXPECT_GE(r.found, 78);
  EXPECT_LT(r.rms_px, 0.035);
  EXPECT_GT(r.mahalanobis, 0.6);
  EXPECT_LT(r.mahalanobis, 1.6);
}

TEST(Detector, SaysHowSureTheCornersOfBlurredMarkersAre) {
  for (const double blur : {2.5, 3.5}) {
    Sweep sweep{60, 120, 45_deg, {}};
    sweep.picture.blur_px = blur;
    sweep.picture.noise_levels = 2;
    const SweepResult r = swept(sweep, 40);
    EXPECT_EQ(r.found, r.markers);
    EXPECT_LT(r.rms_px, 0.08) << blur;
    EXPECT_GT(r.mahalanobis, 0.5) << blur;
    EXPECT_LT(r.mahalanobis, 2) << blur;
  }
}

TEST(Detector, SaysHowSureCornersAreByTheirSidesAlone) {
  Sweep sweep{16, 40, 40_deg, {}};
  sweep.picture.blur_px = 1;
  sweep.picture.noise_levels = 2;
  const SweepResult fitted = swept(sweep, 80);
  sweep.pattern_fits = false;
  const SweepResult r = swept(sweep, 80);
  EXPECT_EQ(r.found, fitted.found);
  EXPECT_GT(r.rms_px, 1.5 * fitted.rms_px);
  EXPECT_LT(r.rms_px, 0.3);
  EXPECT_LT(r.mahalanobis, 1.5);  // much less: the doubt is made for blurs three times as wide
}

TEST(Detector, FindsTheCornersOfBlurredMarkersThroughTheLens) {
  Sweep sweep{120, 180, 45_deg, {}};
  sweep.lens = bent_vga();
  sweep.give_lens = true;
  sweep.picture.blur_px = 3;
  sweep.picture.noise_levels = 2;
  const SweepResult r = swept(sweep, 40);
  EXPECT_EQ(r.found, r.markers);
  EXPECT_LT(r.rms_px, 0.08);  // twice as much where patterns are fitted without the lens
  expect_true_covariance(r);
}

TEST(Detector, FindsTheCornersOfBentPaper) {
  for (const double bow : {0.003, 0.006, 0.012}) {  // 0.2 to 1 px
    SCOPED_TRACE(bow);
    Sweep sweep{60, 80, 30_deg, {}};
    sweep.picture.blur_px = 0.5;
    sweep.picture.noise_levels = 2;
    sweep.bow = bow;
    const SweepResult r = swept(sweep, 25);
    EXPECT_EQ(r.found, r.markers);
    EXPECT_LT(r.rms_px, 0.07) << bow;  // 0.15 and more when straight lines are fitted
    expect_true_covariance(r);
  }
}

TEST(Detector, MovesACornerSteadilyAsItsPaperBends) {
  Detector detector(families({"aruco_4x4_50"}));
  PlacedMarker marker = test::placed(pinhole_vga(), {"aruco_4x4_50", "3"}, {320.3, 240.1}, 60, 0.3, 0.2, 1);
  test::PictureOptions options;
  options.blur_px = 1;
  options.noise_levels = 4;
  constexpr double k_step_px = 0.05;
  std::array<Eigen::Vector2d, 4> before;
  for (int step = 0; step <= 50; ++step) {  // to 2.5 px: past the largest bow that is believed
    marker.bow = k_step_px * step / 60;
    std::mt19937_64 rng(7);  // the same noise in all pictures
    const auto found = detector.detect(
        test::picture_of(pinhole_vga(), test::plain(640, 480, 100), std::vector{marker}, options, rng));
    ASSERT_EQ(found.size(), 1u);
    for (std::size_t k = 0; k < 4 && step > 0; ++k)
      EXPECT_LT((found[0].corners_px[k] - before[k]).norm(), 5 * k_step_px) << step << " corner " << k;
    before = found[0].corners_px;
  }
}

// Every marker of a family in a sheet, turned by quarters: right id, right corner order.
void expect_whole_family(const std::string& family, int count) {
  auto rng = test::test_rng();
  const Lens lens = Lens::pinhole(2000, 2000, 799.5, 599.5);
  Detector detector(families({family}));
  constexpr int k_columns = 16;
  constexpr int k_rows = 12;
  for (int first = 0; first < count; first += k_columns * k_rows) {
    std::vector<PlacedMarker> sheet;
    for (int id = first; id < std::min(count, first + k_columns * k_rows); ++id) {
      const int cell = id - first;
      sheet.push_back(test::placed(lens, {family, std::to_string(id)},
                                   {100.0 * (cell % k_columns) + 50, 100.0 * (cell / k_columns) + 50}, 60,
                                   0.5 * std::numbers::pi * (id % 4) + 0.1, 0.1, 1));
    }
    const cv::Mat grey =
        test::picture_of(lens, test::plain(1600, 1200, 160), sheet, {.noise_levels = 2}, rng);
    const auto found = detector.detect(grey);
    EXPECT_EQ(found.size(), sheet.size());
    for (const PlacedMarker& marker : sheet) {
      const auto truth = test::true_corners(lens, marker);
      int hits = 0;
      for (const Detection& d : found)
        if (d.marker == marker.marker) {
          ++hits;
          for (std::size_t k = 0; k < 4; ++k) EXPECT_TRUE(test::near(d.corners_px[k], truth[k], 0.5));
        }
      EXPECT_EQ(hits, 1) << marker.marker.text();
    }
  }
}

TEST(Detector, FindsAllOfApriltag36h11InAllTurns) { expect_whole_family("apriltag_36h11", 587); }
TEST(Detector, FindsAllOfApriltag25h9InAllTurns) { expect_whole_family("apriltag_25h9", 35); }
TEST(Detector, FindsAllOfApriltag16h5InAllTurns) { expect_whole_family("apriltag_16h5", 30); }
TEST(Detector, FindsAllOfAruco4x4InAllTurns) { expect_whole_family("aruco_4x4_50", 50); }
TEST(Detector, FindsAllOfAruco7x7InAllTurns) { expect_whole_family("aruco_7x7_100", 100); }
TEST(Detector, FindsTheOriginalArucoInAllTurns) { expect_whole_family("aruco_original", 180); }

TEST(Detector, FindsSeveralFamiliesInOnePicture) {
  auto rng = test::test_rng();
  const Lens lens = pinhole_vga();
  const std::vector<std::string> names = {"apriltag_36h11", "aruco_4x4_50", "aruco_6x6_250", "apriltag_25h9"};
  std::vector<PlacedMarker> markers;
  for (std::size_t i = 0; i < names.size(); ++i)
    markers.push_back(
        test::placed(lens, {names[i], "7"}, {100 + 140.0 * static_cast<double>(i), 240}, 70, 0.4, 0.3, 2));
  const auto found =
      Detector(families(names)).detect(test::picture_of(lens, test::plain(640, 480, 40), markers, {}, rng));
  ASSERT_EQ(found.size(), names.size());
  for (const PlacedMarker& marker : markers)
    EXPECT_EQ(
        std::count_if(found.begin(), found.end(), [&](const auto& d) { return d.marker == marker.marker; }),
        1);
}

TEST(Detector, SeesNoMarkersInClutter) {
  auto rng = test::test_rng();
  Detector detector(
      families({"apriltag_36h11", "apriltag_16h5", "aruco_4x4_50", "aruco_6x6_250", "aruco_original"}));
  for (int i = 0; i < 12; ++i) {
    const auto found = detector.detect(test::clutter(1280, 720, rng));
    EXPECT_EQ(found.size(), 0u) << (found.empty() ? "" : found[0].marker.text());
  }
}

TEST(Detector, SeesNoMarkersInNoise) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_1000", "apriltag_16h5"}));
  EXPECT_TRUE(detector.detect(test::noise(640, 480, rng)).empty());
}

TEST(Detector, SurvivesOddPictures) {
  Detector detector(families({"aruco_4x4_50"}));
  EXPECT_TRUE(detector.detect(cv::Mat()).empty());
  for (const auto& [width, height] : {std::pair{1, 1}, {2, 3}, {3, 2}, {5, 7}, {1, 400}, {400, 1}, {13, 13}})
    for (const int grey : {0, 128, 255})
      EXPECT_TRUE(detector.detect(test::plain(width, height, grey)).empty());
  EXPECT_TRUE(detector.detect(test::plain(640, 480, 0)).empty());
}

cv::Mat scattered_markers(int moved_px, std::mt19937_64& rng) {
  std::vector<PlacedMarker> markers;
  for (int i = 0; i < 6; ++i)
    markers.push_back(test::placed(pinhole_vga(), {"apriltag_36h11", std::to_string(i)},
                                   {120.0 + 190 * (i % 3) + moved_px, 130.0 + 210 * (i / 3)}, 60 + 8 * i,
                                   0.4 * i, 0.1 * i, i));
  return test::picture_of(pinhole_vga(), test::clutter(640, 480, rng), markers, {.noise_levels = 2}, rng);
}

void expect_same(const std::vector<Detection>& a, const std::vector<Detection>& b, double within_px) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].marker.id, b[i].marker.id);
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_TRUE(test::near(a[i].corners_px[k], b[i].corners_px[k], within_px));
  }
}

TEST(Detector, FindsTheSameWithAnyNumberOfThreads) {
  auto rng = test::test_rng();
  const cv::Mat grey = scattered_markers(0, rng);
  const auto alone = Detector(families({"apriltag_36h11"})).detect(grey);
  EXPECT_EQ(alone.size(), 6);
  for (const int threads : {2, 3, 5})
    expect_same(Detector(families({"apriltag_36h11"}), {.threads = threads}).detect(grey), alone, 0);
}

TEST(Detector, FollowsMarkersThatMoveByHalfTheirSide) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  const cv::Mat first = scattered_markers(0, rng);
  const auto last = detector.detect(first);
  ASSERT_EQ(last.size(), 6);
  for (const int moved : {0, 1, 5, 12, 25}) {
    const cv::Mat grey = scattered_markers(moved, rng);
    const auto anew = detector.detect(grey);
    std::vector<Detection> found;
    detector.follow(grey, nullptr, last, &found);
    ASSERT_EQ(anew.size(), 6);
    ASSERT_EQ(found.size(), 6) << moved;
    for (const Detection& marker : found) {
      const auto same = std::find_if(anew.begin(), anew.end(),
                                     [&](const Detection& d) { return d.marker.id == marker.marker.id; });
      ASSERT_NE(same, anew.end());
      expect_same({marker}, {*same}, 0.1);
    }
  }
}

TEST(Detector, FollowsMarkersUnderFingersToThePicturesEnd) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  const cv::Mat first = scattered_markers(0, rng);
  const auto last = detector.detect(first);
  cv::Mat covered = first.clone();
  for (const Detection& marker : last) {
    const Eigen::Vector2d at = marker.corners_px[0];
    cv::circle(covered, {static_cast<int>(at.x()), static_cast<int>(at.y())}, 8, cv::Scalar(120), -1);
  }
  std::vector<Detection> found;
  detector.follow(covered, nullptr, last, &found);
  EXPECT_EQ(found.size(), last.size());
  detector.follow(cv::Mat(first, cv::Rect(0, 0, 200, 200)), nullptr, last, &found);
  EXPECT_EQ(found.size(), 1);
  detector.follow(test::plain(640, 480, 100), nullptr, last, &found);
  EXPECT_TRUE(found.empty());
  detector.follow(cv::Mat(), nullptr, last, &found);
  EXPECT_TRUE(found.empty());
}

double square_error(const Detection& found, const std::array<Eigen::Vector2d, 4>& truth) {
  double sum = 0;
  for (std::size_t k = 0; k < 4; ++k) sum += (found.corners_px[k] - truth[k]).squaredNorm();
  return sum / 4;
}

// A blurred marker that moves, and turns in light that falls and rises: its pattern is fitted from nothing
// now and then, and followed between, which is as good.
TEST(Detector, FollowsABlurredMarkerByItsPattern) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  std::vector<Detection> last, found;
  double followed = 0, anew = 0, pulls = 0;
  int fits = 0, count = 0;
  for (int i = 0; i < 100; ++i) {
    const std::vector<PlacedMarker> marker = {test::placed(
        pinhole_vga(), {"apriltag_36h11", "3"}, {300 + 0.37 * i, 240}, 40, 0.2 + 0.01 * i, 20_deg, 0)};
    const int level = 170 + static_cast<int>(40 * std::sin(0.1 * i));
    const cv::Mat grey = test::picture_of(pinhole_vga(), test::plain(640, 480, level), marker,
                                          {.blur_px = 1.2, .noise_levels = 2}, rng);
    const auto truth = test::true_corners(pinhole_vga(), marker[0]);
    if (i == 0)
      detector.detect(grey, nullptr, &found);
    else
      detector.follow(grey, nullptr, last, &found);
    ASSERT_EQ(found.size(), 1u) << i;
    ASSERT_TRUE(found[0].by_pattern) << i;
    if (found[0].by_pattern->age == 0) {
      ++fits;
    } else {
      const auto alone = detector.detect(grey);
      ASSERT_EQ(alone.size(), 1u);
      followed += square_error(found[0], truth);
      anew += square_error(alone[0], truth);
      for (std::size_t k = 0; k < 4; ++k) {
        const Eigen::Vector2d e = found[0].corners_px[k] - truth[k];
        pulls += 0.125 * e.dot(found[0].corner_covariance[k].inverse() * e);
      }
      ++count;
    }
    last = found;
  }
  std::printf("fitted in %d of 100 pictures; between, off by %.3f px, anew by %.3f px RMS; pulls %.2f\n",
              fits, std::sqrt(followed / count), std::sqrt(anew / count), std::sqrt(pulls / count));
  EXPECT_GE(fits, 2);
  EXPECT_LE(fits, 10);
  EXPECT_LT(std::sqrt(followed / count), 0.05);
  EXPECT_LT(followed, 1.4 * 1.4 * anew);
  EXPECT_GT(std::sqrt(pulls / count), 0.7);
  EXPECT_LT(std::sqrt(pulls / count), 1.4);
}

// What was known of a blurred marker's pattern is not believed of what has come in its place.
TEST(Detector, FollowsNoPatternThatIsNoLongerThere) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  const auto seen = [&](const std::string& id, int moved_px, bool finger) {
    const std::vector<PlacedMarker> marker = {
        test::placed(pinhole_vga(), {"apriltag_36h11", id}, {320.0 + moved_px, 240}, 40, 0.2, 20_deg, 0)};
    cv::Mat grey = test::picture_of(pinhole_vga(), test::plain(640, 480, 200), marker,
                                    {.blur_px = 1.2, .noise_levels = 1}, rng);
    const Eigen::Vector2d at = test::true_corners(pinhole_vga(), marker[0])[0];
    if (finger)
      cv::circle(grey, {static_cast<int>(at.x()), static_cast<int>(at.y())}, 9, cv::Scalar(150), -1);
    return grey;
  };
  const auto first = detector.detect(seen("3", 0, false));
  ASSERT_EQ(first.size(), 1u);
  ASSERT_TRUE(first[0].by_pattern);
  std::vector<Detection> found;
  detector.follow(seen("3", 1, false), nullptr, first, &found);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].by_pattern->age, 1);
  detector.follow(seen("4", 0, false), nullptr, first, &found);
  EXPECT_TRUE(found.empty() || found[0].marker.id == "4");
  detector.follow(test::plain(640, 480, 200), nullptr, first, &found);
  EXPECT_TRUE(found.empty());
  detector.follow(seen("3", 0, true), nullptr, first, &found);
  for (const Detection& marker : found) {
    EXPECT_FALSE(marker.corner_visible[0]);
    EXPECT_FALSE(marker.by_pattern && marker.by_pattern->age > 0);
  }
  detector.follow(seen("3", 15, false), nullptr, first, &found);
  ASSERT_EQ(found.size(), 1u);
  const auto anew = detector.detect(seen("3", 15, false));
  for (std::size_t k = 0; k < 4; ++k) EXPECT_LT((found[0].corners_px[k] - anew[0].corners_px[k]).norm(), 0.2);
}

// Markers of one id, 70 px wide and so steep that each lies within half a side of the next.
cv::Mat stacked_markers(int count, double moved_px, std::mt19937_64& rng) {
  std::vector<PlacedMarker> markers;
  for (int i = 0; i < count; ++i)
    markers.push_back(test::placed(pinhole_vga(), {"aruco_4x4_50", "7"}, {320, 200 + 36.0 * i + moved_px}, 70,
                                   0, 68_deg, 0));
  return test::picture_of(pinhole_vga(), test::plain(640, 480, 100), markers, {.noise_levels = 1}, rng);
}

TEST(Detector, FollowsNoSquareTwice) {
  auto rng = test::test_rng();
  Detector detector(families({"aruco_4x4_50"}));
  const auto last = detector.detect(stacked_markers(3, 0, rng));
  ASSERT_EQ(last.size(), 3);
  std::vector<Detection> found;
  for (const double moved_px : {0, 12, 24, 36}) {
    detector.follow(stacked_markers(3, moved_px, rng), nullptr, last, &found);
    ASSERT_FALSE(found.empty()) << moved_px;
    for (std::size_t i = 0; i < found.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        EXPECT_GT((found[i].corners_px[0] - found[j].corners_px[0]).norm(), 25) << moved_px;
  }
  detector.follow(stacked_markers(1, 36, rng), nullptr, last, &found);
  EXPECT_EQ(found.size(), 1);
}

TEST(Detector, FindsMarkersUnderFingersAndSaysWhichCornersAreCovered) {
  auto rng = test::test_rng();
  Detector detector(families({"apriltag_36h11"}));
  for (int i = 0; i < 12; ++i) {
    const PlacedMarker marker = test::placed(pinhole_vga(), {"apriltag_36h11", std::to_string(i)}, {320, 240},
                                             uniform(rng, 70, 120), uniform(rng, 0, 6.28), 20_deg, i);
    cv::Mat light = test::light_of(pinhole_vga(), test::plain(640, 480, 100), std::vector{marker}, {}, rng);
    const auto truth = test::true_corners(pinhole_vga(), marker);
    const double side = (truth[1] - truth[0]).norm();
    cv::circle(light, {static_cast<int>(truth[0].x()), static_cast<int>(truth[0].y())},
               static_cast<int>(0.15 * side), cv::Scalar(120), -1);
    const auto found = detector.detect(test::noisy_grey(light, 2, rng));
    ASSERT_EQ(found.size(), 1u) << i;
    EXPECT_EQ(found[0].corner_visible, (std::array<bool, 4>{false, true, true, true}));
    for (std::size_t k = 0; k < 4; ++k) EXPECT_TRUE(test::near(found[0].corners_px[k], truth[k], 0.3));
  }
}

// Strips of shadow, 4:1, one of which begins on the paper beside the ink: `angle` off one of the marker's
// sides, `beside_px` from its middle.
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
  EXPECT_GE(near, 0.9 * corners);                      // without looking for shadows: half
  EXPECT_LT(std::sqrt(squares / corners), most_pull);  // without: a hundred
}

TEST(Detector, TakesNoShadowsEdgeForTheInks) { expect_no_shadows_edge(pinhole_vga(), 70, 120, 1.2); }
TEST(Detector, TakesNoShadowsEdgeForTheInksThroughALens) { expect_no_shadows_edge(bent_vga(), 120, 160, 2); }

// What was known of a marker's light is not believed when a shadow has come.
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
        detector.detect(test::picture_of(pinhole_vga(), test::plain(640, 480, 90), std::vector{marker},
                                         {.blur_px = 0.5, .noise_levels = 2}, rng));
    ASSERT_EQ(found.size(), 1u) << i;
    const Eigen::Vector2d centre = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_TRUE(test::near(found[0].corners_px[k], truth[k], 0.2));
      outward += (found[0].corners_px[k] - truth[k]).dot((truth[k] - centre).normalized()) / (4 * k_count);
    }
  }
  EXPECT_LT(std::abs(outward), 0.02);  // 0.1 and more by edge lines alone
}

// How long they take: tests/bench/tracker_bench.
TEST(Detector, FindsNothingInHostilePictures) {
  auto rng = test::test_rng();
  constexpr int k_width = 1280;
  constexpr int k_height = 720;
  Detector detector(families({"apriltag_36h11", "artoolkit_3x3"}));
  EXPECT_TRUE(detector.detect(test::noise(k_width, k_height, rng)).empty());
  EXPECT_TRUE(detector.detect(test::nested_squares(k_width, k_height)).empty());
  for (const int square : {1, 3, 8, 20})
    EXPECT_TRUE(detector.detect(test::checkerboard(k_width, k_height, square)).empty()) << square;
}

TEST(Detector, FindsAMarkerInTheLastCornerOfFortyEightMegapixels) {
  auto rng = test::test_rng();
  const cv::Mat part = test::picture_of(
      pinhole_vga(), test::plain(640, 480, 128),
      std::vector{test::placed(pinhole_vga(), {"apriltag_36h11", "3"}, {560, 400}, 90, 0.3, 0.2, 1)},
      {.blur_px = 0.5, .noise_levels = 2}, rng);
  cv::Mat whole = test::plain(8000, 6000, 128);
  part.copyTo(whole(cv::Rect(8000 - 640, 6000 - 480, 640, 480)));
  Detector detector(families({"apriltag_36h11"}));
  const auto in_part = detector.detect(part);
  const auto in_whole = detector.detect(whole);
  ASSERT_EQ(in_part.size(), 1u);
  ASSERT_EQ(in_whole.size(), 1u);
  for (std::size_t k = 0; k < 4; ++k)
    EXPECT_TRUE(test::near(in_whole[0].corners_px[k] - Eigen::Vector2d(8000 - 640, 6000 - 480),
                           in_part[0].corners_px[k], 0.05));
}

TEST(Detector, FindsAMarkerInAPartOfALargerPicture) {
  auto rng = test::test_rng();
  const PlacedMarker marker = test::placed(pinhole_vga(), {"aruco_4x4_50", "3"}, {320, 240}, 80, 0.3, 0.2, 1);
  const cv::Mat whole =
      test::picture_of(pinhole_vga(), test::plain(640, 480, 60), std::vector{marker}, {}, rng);
  const cv::Mat part = whole(cv::Rect(201, 101, 237, 281));  // its rows do not follow each other in memory
  Detector detector(families({"aruco_4x4_50"}));
  const auto in_whole = detector.detect(whole);
  const auto in_part = detector.detect(part);
  ASSERT_EQ(in_part.size(), 1u);
  ASSERT_EQ(in_whole.size(), 1u);
  for (std::size_t k = 0; k < 4; ++k)
    EXPECT_TRUE(
        test::near(in_part[0].corners_px[k] + Eigen::Vector2d(201, 101), in_whole[0].corners_px[k], 0.05));
}

std::string template_text(int size) {
  // An L with a dot: no rotation looks like another.
  const auto grey = [&](int row, int column) {
    const bool stem = column > size / 5 && column < size / 2 && row > size / 8;
    const bool foot = row > size * 3 / 4 && column > size / 5 && column < size * 7 / 8;
    const bool dot = row < size / 3 && column > size * 3 / 4;
    return stem || foot || dot ? 20 : 235;
  };
  std::string text;
  for (int turn = 0; turn < 4; ++turn)
    for (int colour = 0; colour < 3; ++colour)
      for (int row = 0; row < size; ++row) {
        for (int column = 0; column < size; ++column) {
          int r = row;
          int c = column;
          for (int k = 0; k < turn; ++k) {
            const int before = r;
            r = size - 1 - c;
            c = before;
          }
          text += fmt::format(" {:3d}", grey(r, c));
        }
        text += "\n";
      }
  return text;
}

TEST(Detector, FindsATemplateInAllTurns) {
  auto rng = test::test_rng();
  const auto file = test::test_folder() / "letter.patt";
  ASSERT_TRUE(write_file(file, template_text(16)));
  Detector detector(families({"artoolkit:" + file.string()}));
  const MarkerName name{"artoolkit", file.string()};
  for (int turn = 0; turn < 8; ++turn) {
    const PlacedMarker marker =
        test::placed(pinhole_vga(), name, {320, 240}, 110, turn * 45_deg, 35_deg, turn);
    test::PictureOptions options;
    options.noise_levels = 2;
    const auto found = detector.detect(
        test::picture_of(pinhole_vga(), test::plain(640, 480, 90), std::vector{marker}, options, rng));
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].marker.text(), "artoolkit:letter.patt");
    EXPECT_GT(found[0].score, 0.9);
    const auto truth = test::true_corners(pinhole_vga(), marker);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_TRUE(test::near(found[0].corners_px[k], truth[k], 0.2));
  }
}

std::string load_message(const std::string& name) {
  const auto loaded = Families::load(std::vector<std::string>{name});
  return loaded ? "loaded" : loaded.message();
}

TEST(Families, SaysWhatIsWrongWithAName) {
  EXPECT_NE(load_message("aruco_9x9_50").find("aruco_4x4_50"), std::string::npos);
  EXPECT_NE(load_message("aruco:").find("expected one of"), std::string::npos);
  EXPECT_NE(load_message("artoolkit:absent.patt").find("absent.patt"), std::string::npos);
}

TEST(Families, SaysWhatIsWrongWithATemplateFile) {
  const auto file = test::test_folder() / "broken.patt";
  const std::string good = template_text(16);
  ASSERT_TRUE(write_file(file, good.substr(0, good.size() / 2)));
  EXPECT_NE(load_message("artoolkit:" + file.string()).find("cut short"), std::string::npos);
  ASSERT_TRUE(write_file(file, "not a pattern"));
  EXPECT_NE(load_message("artoolkit:" + file.string()).find("expected numbers"), std::string::npos);
  ASSERT_TRUE(write_file(file, ""));
  EXPECT_NE(load_message("artoolkit:" + file.string()).find("found 0"), std::string::npos);
  ASSERT_TRUE(write_file(file, good.substr(0, good.rfind("235"))));
  EXPECT_NE(load_message("artoolkit:" + file.string()).find("found 3071"), std::string::npos);
}

TEST(Families, SaysWhatIsWrongWithADictionaryFile) {
  const auto file = test::test_folder() / "broken.yml";
  const auto message = [&](const std::string& text) {
    EXPECT_TRUE(write_file(file, text));
    return load_message("aruco:" + file.string());
  };
  EXPECT_NE(message("%YAML:1.0\nnmarkers: 2\nmarkersize: 3\nmarker_0: \"010101010\"\n").find("marker_1"),
            std::string::npos);
  EXPECT_NE(message("%YAML:1.0\nnmarkers: 1\nmarkersize: 3\nmarker_0: \"01\"\n").find("9 characters"),
            std::string::npos);
  EXPECT_NE(message("%YAML:1.0\nnmarkers: 1\nmarkersize: 30\nmarker_0: \"01\"\n").find("markersize"),
            std::string::npos);
  EXPECT_NE(message("%YAML:1.0\nnmarkers: [").find("broken.yml"), std::string::npos);
  EXPECT_NE(message("").find("broken.yml"), std::string::npos);
  EXPECT_EQ(message("%YAML:1.0\nnmarkers: 1\nmarkersize: 3\nmarker_0: \"010110100\"\n"), "loaded");
}

TEST(Families, DrawsOnlyIdsThatExist) {
  EXPECT_TRUE(draw_marker({"aruco_4x4_50", "49"}, 4));
  EXPECT_NE(draw_marker({"aruco_4x4_50", "50"}, 4).message().find("0 to 49"), std::string::npos);
  EXPECT_FALSE(draw_marker({"aruco_4x4_50", "-1"}, 4));
  EXPECT_FALSE(draw_marker({"aruco_4x4_50", "3x"}, 4));
}

TEST(Families, AreNamedOnceForTheMarkersOfBodies) {
  const std::vector<Body> bodies = {
      {"prototype", {{{"aruco_4x4_50", "1"}, 0.04, {}}, {{"aruco_4x4_50", "2"}, 0.04, {}}}},
      {"slot", {{{"artoolkit", "hiro.patt"}, 0.08, {}}}}};
  EXPECT_EQ(families_of(bodies), (std::vector<std::string>{"aruco_4x4_50", "artoolkit:hiro.patt"}));
}

}  // namespace
}  // namespace limn::tracker
