#include "tracker/barcode.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/image_io.h"
#include "tests/support/matchers.h"
#include "tests/tracker/vga_markers.h"
#include "tracker/detector.h"

namespace limn::tracker {
namespace {

std::vector<std::uint32_t> words(const std::string& name) {
  const Barcode& barcode = *find_barcode(name);
  std::vector<std::uint32_t> result;
  for (std::size_t id = 0; id < barcode.ids(); ++id) result.push_back(barcode_word(barcode, id));
  return result;
}

int smallest_distance(const std::vector<std::uint32_t>& words) {
  int smallest = 32;
  for (std::size_t i = 1; i < words.size(); ++i)
    smallest = std::min(smallest, std::popcount(words[i] ^ words[0]));  // the codes are linear
  return smallest;
}

// The encoder tables that ARToolKit 5 lists beside its decoders, lib/SRC/AR/arPattGetID.c.
TEST(Barcode, WordsAreThoseThatARToolKitDecodes) {
  EXPECT_EQ(words("artoolkit_3x3_hamming63"), (std::vector<std::uint32_t>{0, 7, 25, 30, 42, 45, 51, 52}));
  const auto parity = words("artoolkit_3x3_parity65");
  ASSERT_EQ(parity.size(), 32u);
  EXPECT_EQ((std::vector<std::uint32_t>(parity.begin(), parity.begin() + 9)),
            (std::vector<std::uint32_t>{0, 33, 34, 3, 36, 5, 6, 39, 40}));
  EXPECT_EQ(parity[31], 63u);
}

// The names give length, data bits and smallest distance. ARToolKit reads the id from the highest bits.
TEST(Barcode, BchCodesKeepTheDistanceOfTheirNames) {
  for (const auto& [name, bits, distance] :
       {std::tuple{"artoolkit_4x4_bch_13_9_3", 13, 3}, std::tuple{"artoolkit_4x4_bch_13_5_5", 13, 5},
        std::tuple{"artoolkit_5x5_bch_22_12_5", 22, 5}, std::tuple{"artoolkit_5x5_bch_22_7_7", 22, 7}}) {
    const auto all = words(name);
    EXPECT_EQ(smallest_distance(all), distance) << name;
    const int checks = bits - std::countr_zero(all.size());
    for (std::size_t id = 0; id < all.size(); ++id) ASSERT_EQ(all[id] >> checks, id) << name;
  }
}

// As get_matrix_code draws direction 0: black at the top left and bottom left, white at the bottom right. Id
// 5 = 000101 makes the middle cell and the one below it black.
TEST(Barcode, CellsStandUprightAsInARToolKit) {
  EXPECT_EQ(barcode_cells(*find_barcode("artoolkit_3x3"), 0), 0b011'111'011u);
  EXPECT_EQ(barcode_cells(*find_barcode("artoolkit_3x3"), 5), 0b011'101'001u);
  EXPECT_EQ(barcode_cells(*find_barcode("artoolkit_3x3"), 63), 0b000'000'001u);
  EXPECT_EQ(barcode_cells(*find_barcode("artoolkit_4x4"), 1), 0b0111'1111'1111'0101u);
}

TEST(Barcode, AllLookDifferentFromAllSides) {
  for (const Barcode& barcode : barcodes()) {
    const CodeFamily family = families({std::string(barcode.name)}).codes().front();
    std::set<std::uint64_t> seen;
    for (const auto& turns : family.codes) seen.insert(turns.begin(), turns.end());
    EXPECT_EQ(seen.size(), 4 * barcode.ids()) << barcode.name;
  }
}

struct Count {
  int shown = 0, found = 0, wrong = 0;
  double worst_px = 0;
};

// One marker in each image; its id is the image's number.
Count seen(const std::string& family,
           double low_px,
           double high_px,
           const cv::Mat& background,
           const test::ImageOptions& options,
           int count) {
  auto rng = test::test_rng();
  const Lens lens = pinhole_vga();
  Detector detector(families({family}));
  const std::size_t ids = find_barcode(family)->ids();
  Count result;
  for (int i = 0; i < count; ++i) {
    const MarkerName name{family, std::to_string(static_cast<std::size_t>(i) * 977 % ids)};
    const PlacedMarker marker = test::placed(lens, name, {uniform(rng, 120, 520), uniform(rng, 120, 360)},
                                             uniform(rng, low_px, high_px), uniform(rng, 0, 6.28),
                                             uniform(rng, 0, 55_deg), uniform(rng, 0, 6.28));
    const auto truth = test::true_corners(lens, marker);
    ++result.shown;
    for (const Detection& found :
         detector.detect(test::image_of(lens, background, std::vector{marker}, options, rng))) {
      const double off = (found.corners_px[0] - truth[0]).norm();
      const bool right = found.marker == name && off < 3;
      right ? ++result.found : ++result.wrong;
      if (right) result.worst_px = std::max(result.worst_px, off);
      if (!right)
        ADD_FAILURE() << found.marker.text() << " at " << found.corners_px[0].transpose() << " of " << off;
    }
  }
  return result;
}

TEST(Barcode, AreFoundAllAroundAmongClutter) {
  auto rng = test::test_rng();
  const cv::Mat clutter = test::clutter(640, 480, rng);
  for (const auto& [family, low] : {std::pair{"artoolkit_3x3", 30.0}, std::pair{"artoolkit_4x4", 40.0},
                                    std::pair{"artoolkit_5x5_bch_22_7_7", 50.0}}) {
    const Count count = seen(family, low, 120, clutter, {.blur_px = 0.6, .noise_levels = 2}, 64);
    EXPECT_GE(count.found, 62) << family;
    EXPECT_EQ(count.wrong, 0) << family;
    EXPECT_LT(count.worst_px, 0.5) << family;
  }
}

TEST(Barcode, AreFoundWhereLightIsPoor) {
  const Count dim = seen("artoolkit_3x3", 30, 120, test::plain(640, 480, 45),
                         {.black = 20, .white = 70, .blur_px = 1, .noise_levels = 2}, 32);
  EXPECT_GE(dim.found, 31);
  EXPECT_EQ(dim.wrong, 0);
  const Count small =
      seen("artoolkit_3x3", 20, 30, test::plain(640, 480, 120), {.blur_px = 0.6, .noise_levels = 2}, 32);
  EXPECT_GE(small.found, 29);
  EXPECT_EQ(small.wrong, 0);
}

// Hundreds of black squares whose inside is no barcode: markers of other families. If only the six bits were
// checked, half of their random insides would be read.
TEST(Barcode, MarkersOfOtherFamiliesAreNone) {
  auto rng = test::test_rng();
  const Lens lens = pinhole_vga();
  Detector detector(families({"artoolkit_3x3", "artoolkit_4x4"}));
  int shown = 0, taken = 0;
  for (const std::string family :
       {"aruco_4x4_50", "aruco_5x5_50", "aruco_6x6_50", "apriltag_16h5", "apriltag_36h11"})
    for (int i = 0; i < 30; i += 6) {
      std::vector<PlacedMarker> markers;
      for (int k = 0; k < 6; ++k)
        markers.push_back(test::placed(
            lens, {family, std::to_string(i + k)}, {120 + 200 * (k % 3), 140 + 200 * (k / 3)},
            uniform(rng, 24, 110), uniform(rng, 0, 6.28), uniform(rng, 0, 50_deg), uniform(rng, 0, 6.28)));
      const cv::Mat grey =
          test::image_of(lens, test::plain(640, 480, 100), markers, {.blur_px = 0.6, .noise_levels = 2}, rng);
      shown += 6;
      taken += static_cast<int>(detector.detect(grey).size());
    }
  EXPECT_EQ(shown, 150);
  EXPECT_EQ(taken, 0);
}

TEST(Barcode, MixWithOtherFamiliesInOneImage) {
  auto rng = test::test_rng();
  const Lens lens = pinhole_vga();
  const std::vector<std::string> names = {"apriltag_36h11", "artoolkit_3x3", "aruco_4x4_50", "artoolkit_4x4"};
  std::vector<PlacedMarker> markers;
  std::set<std::string> shown, found;
  for (int k = 0; k < 12; ++k) {
    const MarkerName name{names[static_cast<std::size_t>(k % 4)], std::to_string(k + 3)};
    shown.insert(name.text());
    markers.push_back(test::placed(lens, name, {90 + 150 * (k % 4), 90 + 150 * (k / 4)}, 70,
                                   uniform(rng, 0, 6.28), uniform(rng, 0, 40_deg), uniform(rng, 0, 6.28)));
  }
  const cv::Mat grey =
      test::image_of(lens, test::plain(640, 480, 100), markers, {.blur_px = 0.6, .noise_levels = 2}, rng);
  for (const Detection& detection : Detector(families(names)).detect(grey))
    found.insert(detection.marker.text());
  EXPECT_EQ(found, shown);
}

// The cells of marker 8 of 3x3 and marker 544 of 4x4 end 1/24 of the side apart, in every rotation.
TEST(Barcode, IsToldFromALargerOneWhicheverWayItIsTurned) {
  auto rng = test::test_rng();
  const Lens lens = pinhole_vga();
  const std::vector<std::string> names = {"artoolkit_3x3", "artoolkit_4x4"};
  const std::vector<MarkerName> markers = {{"artoolkit_3x3", "8"}, {"artoolkit_4x4", "544"}};
  for (const MarkerName& name : markers)
    for (int turn = 0; turn < 4; ++turn) {
      const std::vector<PlacedMarker> placed = {
          test::placed(lens, name, {320, 240}, 70, turn * 90_deg, 0, 0)};
      const cv::Mat grey =
          test::image_of(lens, test::plain(640, 480, 100), placed, {.blur_px = 0.6, .noise_levels = 2}, rng);
      const auto found = Detector(families(names)).detect(grey);
      ASSERT_EQ(found.size(), 1U) << name.text() << " turned " << turn << " times";
      EXPECT_EQ(found[0].marker, name);
    }
}

// Nothing is found in 219 photographs: 210 of Gray code stripes on a wall and a chessboard, 9 of other
// families' markers.
TEST(Barcode, PhotographsWithoutThemShowNone) {
  const auto folder = test::real_data("");
  if (!folder) GTEST_SKIP() << "no photographs";
  Detector detector(families({"artoolkit_3x3"}));
  int images = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(*folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension != ".png" && extension != ".jpg") continue;
    // Every sixth pair of a Gray code's images, by its number in the sequence.
    const std::string stem = entry.path().stem().string();
    if (stem.rfind("graycode_", 0) == 0 && std::stoi(stem.substr(9)) % 12 > 1) continue;
    ++images;
    for (const Detection& found : detector.detect(read_grey_image(entry.path()).value()))
      ADD_FAILURE() << entry.path() << ": " << found.marker.text() << " at "
                    << found.corners_px[0].transpose();
  }
  EXPECT_GE(images, 40);
}

// Their cells are wider or narrower than those of other families, whose codes they may show by chance. Three
// in a hundred were misread when the first family that accepts a quad won.
TEST(Barcode, AreNotTakenForCodesOfOtherFamilies) {
  auto rng = test::test_rng();
  Detector detector(families(
      {"aruco_4x4_1000", "aruco_6x6_250", "artoolkit_4x4", "artoolkit_3x3", "artoolkit_5x5_bch_22_12_5"}));
  int read = 0;
  for (int i = 0; i < 120; ++i) {
    const bool three = i % 2 == 0;
    const MarkerName name = three ? MarkerName{"artoolkit_3x3", std::to_string(i % 64)}
                                  : MarkerName{"artoolkit_5x5_bch_22_12_5", std::to_string(33 * i)};
    const PlacedMarker marker = test::placed(pinhole_vga(), name, {320, 240}, uniform(rng, 20, 70),
                                             uniform(rng, 0, 6.28), uniform(rng, 0, 70_deg), i);
    const auto found = detector.detect(
        test::image_of(pinhole_vga(), test::plain(640, 480, 100), std::vector{marker},
                       {.blur_px = uniform(rng, 0.4, 2.5), .noise_levels = uniform(rng, 2, 12)}, rng));
    for (const Detection& detection : found) {
      ++read;
      EXPECT_EQ(detection.marker, name);
      EXPECT_GE(detection.score, k_min_confidence);
    }
  }
  EXPECT_GT(read, 60);
}

}  // namespace
}  // namespace limn::tracker
