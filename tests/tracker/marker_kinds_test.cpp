#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <set>
#include <string>
#include <vector>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "tests/tracker/template_text.h"
#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"
#include "tracker/template_training.h"

/// Markers of other kinds than black squares with a border of one cell, and markers of families that are not
/// searched for.
namespace limn::tracker {
namespace {

std::vector<Detection> detected(const std::vector<std::string>& names, const cv::Mat& image) {
  return Detector(Families::load(names).value()).detect(image);
}

cv::Mat picture(const std::vector<PlacedMarker>& markers, int ground, std::mt19937_64& rng) {
  return test::image_of(pinhole_vga(), test::plain(640, 480, ground), markers,
                        {.blur_px = 0.6, .noise_levels = 2}, rng);
}

PlacedMarker placed(const MarkerName& name, double x, double y, double side_px, double spin, double tilt) {
  return test::placed(pinhole_vga(), name, {x, y}, side_px, spin, tilt, 1.1);
}

testing::AssertionResult is_at(const Detection& detection, const PlacedMarker& marker) {
  const auto truth = test::true_corners(pinhole_vga(), marker);
  for (std::size_t i = 0; i < 4; ++i)
    if (testing::AssertionResult near = test::near(detection.corners_px[i], truth[i], 0.15); !near)
      return near << ", corner " << i << " of " << detection.marker.text();
  return testing::AssertionSuccess();
}

// Expects exactly these markers, each at its place.
void expect_found(const std::vector<Detection>& found, const std::vector<PlacedMarker>& markers) {
  EXPECT_EQ(found.size(), markers.size());
  for (const PlacedMarker& marker : markers) {
    const auto same = std::ranges::find(found, marker.marker, &Detection::marker);
    ASSERT_NE(same, found.end()) << marker.marker.text();
    EXPECT_TRUE(is_at(*same, marker));
  }
}

TEST(MarkerKinds, InvertedMarkersAreReadByTheirWord) {
  auto rng = test::test_rng();
  for (const double margin : {0.0, 0.125}) {  // in a dark room, and on white paper
    std::vector<PlacedMarker> markers = {placed({"aruco_4x4_50_inverted", "7"}, 120, 150, 90, 0.2, 0.5),
                                         placed({"apriltag_36h11_inverted", "5"}, 300, 150, 100, 1.9, 0.4),
                                         placed({"artoolkit_3x3_inverted", "11"}, 480, 150, 90, 4.0, 0.3),
                                         placed({"aruco_6x6_250", "12"}, 320, 360, 90, 2.8, 0.3)};
    for (PlacedMarker& marker : markers) marker.margin = margin;
    markers.back().margin = 0.125;
    expect_found(detected({"aruco_4x4_50_inverted", "apriltag_36h11_inverted", "artoolkit_3x3_inverted",
                           "aruco_6x6_250"},
                          picture(markers, 90, rng)),
                 markers);
    EXPECT_EQ(detected({"aruco_4x4_50", "apriltag_36h11", "artoolkit_3x3"}, picture(markers, 90, rng)).size(),
              0u);
  }
}

TEST(MarkerKinds, InvertedMarkersAreFollowed) {
  auto rng = test::test_rng();
  Detector detector(
      Families::load(std::vector<std::string>{"aruco_4x4_50_inverted", "aruco_4x4_50"}).value());
  const std::vector<PlacedMarker> before = {placed({"aruco_4x4_50_inverted", "7"}, 200, 200, 80, 0.2, 0.3),
                                            placed({"aruco_4x4_50", "7"}, 400, 200, 80, 0.2, 0.3)};
  const std::vector<PlacedMarker> after = {placed({"aruco_4x4_50_inverted", "7"}, 209, 204, 80, 0.25, 0.3),
                                           placed({"aruco_4x4_50", "7"}, 394, 206, 80, 0.15, 0.3)};
  const auto first = detector.detect(picture(before, 110, rng));
  expect_found(first, before);
  std::vector<Detection> followed;
  detector.follow(picture(after, 110, rng), nullptr, first, &followed);
  expect_found(followed, after);
}

// The same cells in a border of two cells, as Kalibr prints them.
PlacedMarker in_wide_border(PlacedMarker marker) {
  cv::copyMakeBorder(draw_marker(marker.marker, 1).value(), marker.cells, 1, 1, 1, 1, cv::BORDER_CONSTANT,
                     cv::Scalar(0));
  return marker;
}

TEST(MarkerKinds, BordersOfTwoCellsAreRead) {
  auto rng = test::test_rng();
  const std::vector<PlacedMarker> markers = {
      in_wide_border(placed({"apriltag_36h11", "5"}, 110, 120, 110, 0.1, 0.5)),
      in_wide_border(placed({"apriltag_25h9", "3"}, 320, 120, 100, 1.7, 0.4)),
      in_wide_border(placed({"aruco_7x7_50", "20"}, 520, 120, 110, 3.0, 0.3)),
      placed({"apriltag_36h11", "6"}, 110, 350, 110, 4.5, 0.4)};
  const cv::Mat image = picture(markers, 110, rng);
  expect_found(detected({"apriltag_36h11", "apriltag_25h9", "aruco_7x7_50"}, image), markers);
  EXPECT_EQ(detected({"aruco_4x4_1000", "aruco_5x5_1000", "aruco_6x6_1000"}, image).size(), 0u);
}

// The marker with a narrow white margin on a dark card that is `card` cells wide around it.
PlacedMarker on_dark_card(PlacedMarker marker, double card) {
  constexpr int k_cell = 25, k_margin = 8;
  const int wide = static_cast<int>(card * k_cell);
  const cv::Mat cells = draw_marker(marker.marker, 1).value();
  cv::resize(cells, marker.cells, {}, k_cell, k_cell, cv::INTER_NEAREST);
  cv::copyMakeBorder(marker.cells, marker.cells, k_margin, k_margin, k_margin, k_margin, cv::BORDER_CONSTANT,
                     cv::Scalar(255));
  cv::copyMakeBorder(marker.cells, marker.cells, wide, wide, wide, wide, cv::BORDER_CONSTANT, cv::Scalar(0));
  marker.size_m *= static_cast<double>(marker.cells.cols) / (k_cell * cells.cols);
  return marker;
}

TEST(MarkerKinds, ADarkCardIsNoBorder) {
  auto rng = test::test_rng();
  for (int i = 0; i < 24; ++i) {
    const PlacedMarker marker = placed({"apriltag_36h11", std::to_string(i)}, 320, 240, uniform(rng, 50, 120),
                                       uniform(rng, 0, 6.28), uniform(rng, 0, 0.8));
    const cv::Mat image = picture({on_dark_card(marker, uniform(rng, 0.5, 1.2))}, 160, rng);
    expect_found(detected({"apriltag_36h11"}, image), {marker});
  }
}

// A part of Kalibr's AprilGrid: squares between the tags touch the tags' corners.
TEST(MarkerKinds, TagsOfAnAprilGridAreRead) {
  auto rng = test::test_rng();
  constexpr int k_tag = 10, k_gap = 3, k_pitch = k_tag + k_gap;
  cv::Mat grid(2 * k_pitch + k_gap, 3 * k_pitch + k_gap, CV_8UC1, cv::Scalar(255));
  std::set<std::string> expected;
  for (int row = 0; row <= 2; ++row)
    for (int column = 0; column <= 3; ++column) {
      grid(cv::Rect(column * k_pitch, row * k_pitch, k_gap, k_gap)).setTo(0);
      if (row == 2 || column == 3) continue;
      const std::string id = std::to_string(3 * row + column);
      expected.insert(id);
      const cv::Mat tag = in_wide_border(placed({"apriltag_36h11", id}, 0, 0, 1, 0, 0)).cells;
      tag.copyTo(grid(cv::Rect(column * k_pitch + k_gap, row * k_pitch + k_gap, k_tag, k_tag)));
    }
  for (const double scale : {6.0, 10.0, 14.0}) {
    cv::Mat large, image(480, 640, CV_8UC1, cv::Scalar(235));
    cv::resize(grid, large, {}, scale, scale, cv::INTER_NEAREST);
    large.copyTo(image(cv::Rect(30, 30, large.cols, large.rows)));
    cv::warpAffine(image, image, cv::getRotationMatrix2D({320, 240}, 4, 0.98), image.size(), cv::INTER_LINEAR,
                   cv::BORDER_REPLICATE);
    cv::GaussianBlur(image, image, {}, 0.8);
    image = test::noisy_grey(cv::Mat_<float>(image), 2, rng);
    std::set<std::string> found;
    for (const Detection& detection : detected({"apriltag_36h11"}, image)) found.insert(detection.marker.id);
    EXPECT_EQ(found, expected) << scale;
  }
}

TEST(MarkerKinds, TemplatesAreReadAndTrainedWithTheirPatternRatio) {
  auto rng = test::test_rng();
  const auto folder = test::test_folder();
  ASSERT_TRUE(write_file(folder / "l.patt", template_text(16)));
  for (const std::string ratio : {"0.7", "0.8", "0.9"}) {
    const std::string id = (folder / "l.patt").string() + "@" + ratio;
    const PlacedMarker marker = placed({"artoolkit", id}, 320, 240, 220, 1.3, 0.5);
    const cv::Mat image = picture({marker}, 110, rng);
    const auto found = detected({"artoolkit:" + id}, image);
    ASSERT_EQ(found.size(), 1u) << ratio;
    EXPECT_EQ(found[0].marker.text(), "artoolkit:l.patt@" + ratio);
    EXPECT_TRUE(is_at(found[0], marker));
    EXPECT_EQ(detected({"artoolkit:" + (folder / "l.patt").string()}, image).size(), 0u);

    const cv::Mat upright = picture({placed({"artoolkit", id}, 320, 240, 220, 0.1, 0.3)}, 110, rng);
    const auto trained = train_template(upright, std::stod(ratio));
    ASSERT_TRUE(trained) << trained.message();
    const auto learned = folder / "learned.patt";
    ASSERT_TRUE(write_file(learned, template_text(*trained)));
    EXPECT_EQ(detected({"artoolkit:" + learned.string() + "@" + ratio}, image).size(), 1u) << ratio;
  }
}

// Markers of one family in pictures in which others are searched for: as large as these, cells of another
// grid show.
TEST(MarkerKinds, MarkersOfOtherFamiliesAreNotReported) {
  auto rng = test::test_rng();
  const std::vector<std::string> names = {
      "aruco_4x4_50",   "aruco_4x4_250", "aruco_5x5_100",   "aruco_6x6_250",  "aruco_7x7_250",
      "apriltag_36h11", "apriltag_25h9", "aruco_mip_36h12", "apriltag_41h12", "artoolkit_4x4_bch_13_5_5"};
  std::vector<Detector> detectors;
  for (const std::string& name : names) detectors.emplace_back(Families::load(std::vector{name}).value());
  std::uniform_real_distribution<double> any(0, 1);
  for (const std::string& shown : names) {
    std::vector<PlacedMarker> markers;
    for (int i = 0; i < 12; ++i)
      markers.push_back(placed({shown, std::to_string(rng() % 30)}, 80 + 160 * (i % 4), 80 + 160 * (i / 4),
                               30 + 30 * any(rng), 6.28 * any(rng), 0.7 * any(rng)));
    const cv::Mat image = picture(markers, 110, rng);
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::size_t found = detectors[i].detect(image).size();
      const bool shares_codes = shown.starts_with("aruco_4x4") && names[i].starts_with("aruco_4x4");
      if (names[i] == shown) {
        EXPECT_GE(found, 11u) << shown;
      } else if (!shares_codes) {
        EXPECT_EQ(found, 0u) << shown << " read as " << names[i];
      }
    }
  }
}

}  // namespace
}  // namespace limn::tracker
