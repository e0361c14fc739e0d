#include "tracker/detector.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/file.h"
#include "tests/tracker/template_text.h"
#include "tests/tracker/vga_markers.h"

namespace limn::tracker {
namespace {

// Every marker of a family in a sheet, in quarter turns: ids and corner order are right.
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
    const cv::Mat grey = test::image_of(lens, test::plain(1600, 1200, 160), sheet, {.noise_levels = 2}, rng);
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

TEST(Detector, FindsSeveralFamiliesInOneImage) {
  auto rng = test::test_rng();
  const Lens lens = pinhole_vga();
  const std::vector<std::string> names = {"apriltag_36h11", "aruco_4x4_50", "aruco_6x6_250", "apriltag_25h9"};
  std::vector<PlacedMarker> markers;
  for (std::size_t i = 0; i < names.size(); ++i)
    markers.push_back(
        test::placed(lens, {names[i], "7"}, {100 + 140.0 * static_cast<double>(i), 240}, 70, 0.4, 0.3, 2));
  const auto found =
      Detector(families(names)).detect(test::image_of(lens, test::plain(640, 480, 40), markers, {}, rng));
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

TEST(Detector, SurvivesOddImages) {
  Detector detector(families({"aruco_4x4_50"}));
  EXPECT_TRUE(detector.detect(cv::Mat()).empty());
  for (const auto& [width, height] : {std::pair{1, 1}, {2, 3}, {3, 2}, {5, 7}, {1, 400}, {400, 1}, {13, 13}})
    for (const int grey : {0, 128, 255})
      EXPECT_TRUE(detector.detect(test::plain(width, height, grey)).empty());
  EXPECT_TRUE(detector.detect(test::plain(640, 480, 0)).empty());
}

TEST(Detector, FindsTheSameWithAnyNumberOfThreads) {
  auto rng = test::test_rng();
  const cv::Mat grey = scattered_markers(0, rng);
  const auto alone = Detector(families({"apriltag_36h11"})).detect(grey);
  EXPECT_EQ(alone.size(), 6);
  for (const int threads : {2, 3, 5})
    expect_same(Detector(families({"apriltag_36h11"}), {.threads = threads}).detect(grey), alone, 0);
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

// tests/bench/tracker_bench measures how long they take.
TEST(Detector, FindsNothingInHostileImages) {
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
  const cv::Mat part = test::image_of(
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

TEST(Detector, FindsAMarkerInAPartOfALargerImage) {
  auto rng = test::test_rng();
  const PlacedMarker marker = test::placed(pinhole_vga(), {"aruco_4x4_50", "3"}, {320, 240}, 80, 0.3, 0.2, 1);
  const cv::Mat whole =
      test::image_of(pinhole_vga(), test::plain(640, 480, 60), std::vector{marker}, {}, rng);
  const cv::Mat part = whole(cv::Rect(201, 101, 237, 281));  // its rows are not contiguous in memory
  Detector detector(families({"aruco_4x4_50"}));
  const auto in_whole = detector.detect(whole);
  const auto in_part = detector.detect(part);
  ASSERT_EQ(in_part.size(), 1u);
  ASSERT_EQ(in_whole.size(), 1u);
  for (std::size_t k = 0; k < 4; ++k)
    EXPECT_TRUE(
        test::near(in_part[0].corners_px[k] + Eigen::Vector2d(201, 101), in_whole[0].corners_px[k], 0.05));
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
    test::ImageOptions options;
    options.noise_levels = 2;
    const auto found = detector.detect(
        test::image_of(pinhole_vga(), test::plain(640, 480, 90), std::vector{marker}, options, rng));
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].marker.text(), "artoolkit:letter.patt");
    EXPECT_GT(found[0].score, 0.9);
    const auto truth = test::true_corners(pinhole_vga(), marker);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_TRUE(test::near(found[0].corners_px[k], truth[k], 0.2));
  }
}

}  // namespace
}  // namespace limn::tracker
