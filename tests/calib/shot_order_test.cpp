#include "calib/code/shot_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "calib/code/decode.h"
#include "calib/code/white_black.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/calib/code_bench.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

// How a program stores what it shows, and what happens to the camera's images.
struct Stored {
  std::string name = {};
  bool rows_first = false, finest_first = false, inverse_first = false, inverses = true, rows = true;
  std::string white = "last";  // first, last, absent; with "black" before it: black before white
  int step_px = 1;
  std::string ending = ".png";
  int quality = 95;
  double noise = 0;
  int turned = -1;  // cv::RotateFlags
  bool mirrored = false;
};

// A series as stored, and for each image of the code its place there (-1: absent).
struct Series {
  std::vector<fs::path> files;
  std::vector<int> places;
  std::vector<cv::Mat> photos;  // in the order of the code
};

// The indices of one axis's images of a code with inverses, in the order in which they are stored.
std::vector<int> axis_images(const Stored& stored, int first_bit, int bits) {
  std::vector<int> images;
  for (int i = 0; i < bits; ++i) {
    const int image = 2 * (first_bit + (stored.finest_first ? bits - 1 - i : i));
    if (!stored.inverses) {
      images.push_back(image);
      continue;
    }
    images.push_back(stored.inverse_first ? image + 1 : image);
    images.push_back(stored.inverse_first ? image : image + 1);
  }
  return images;
}

Series store(const Stored& stored, const fs::path& folder) {
  test::CodeBench bench;
  bench.noise = stored.noise;
  bench.patterns = Patterns::create(PatternCode::gray, 64, 64, {.step_px = stored.step_px}).value();
  const int bits = bench.patterns.column_bits();
  std::vector<int> sequence = axis_images(stored, 0, bits), rows = axis_images(stored, bits, bits);
  if (stored.rows)
    sequence.insert(stored.rows_first ? sequence.begin() : sequence.end(), rows.begin(), rows.end());
  std::vector<int> white = {bench.patterns.white(), bench.patterns.black()};
  if (stored.white.starts_with("black")) std::reverse(white.begin(), white.end());
  if (stored.white != "absent")
    sequence.insert(stored.white.ends_with("first") ? sequence.begin() : sequence.end(), white.begin(),
                    white.end());
  Series series;
  series.photos = bench.photographs();
  EXPECT_TRUE(make_folder(folder).ok());
  for (cv::Mat& photo : series.photos) {
    if (stored.turned >= 0) cv::rotate(photo, photo, stored.turned);
    if (stored.mirrored) cv::flip(photo, photo, 1);
  }
  for (const int image : sequence) {
    series.files.push_back(folder / (std::to_string(series.files.size()) + stored.ending));
    EXPECT_TRUE(cv::imwrite(series.files.back().string(), series.photos[static_cast<size_t>(image)],
                            {cv::IMWRITE_JPEG_QUALITY, stored.quality}));
  }
  for (int i = 0; i < bench.patterns.count(); ++i) {
    if (!stored.inverses && i < bench.patterns.white() && i % 2 == 1) continue;
    if (!stored.rows && i >= 2 * bits && i < bench.patterns.white()) continue;
    const auto at = std::find(sequence.begin(), sequence.end(), i);
    series.places.push_back(at == sequence.end() ? -1 : static_cast<int>(at - sequence.begin()));
  }
  return series;
}

class ShotOrders : public testing::TestWithParam<Stored> {};

TEST_P(ShotOrders, AreFoundInTheImages) {
  const Series series = store(GetParam(), test::test_folder());
  const auto found = find_shot_order({series.files}, 64, 64);
  ASSERT_TRUE(found.ok()) << found.message();
  EXPECT_FALSE(found->is_assumed);
  EXPECT_EQ(found->order.step_px, GetParam().step_px);
  EXPECT_EQ(found->patterns.count(), static_cast<int>(found->shots.size()));
  EXPECT_EQ(found->shots, series.places) << to_text(found->order);
}

INSTANTIATE_TEST_SUITE_P(
    Stored,
    ShotOrders,
    testing::Values(
        Stored{.name = "OpenCv"},
        Stored{.name = "WhiteFirst", .white = "first"},
        Stored{.name = "BlackAndWhiteFirst", .white = "black first"},
        Stored{.name = "BlackAndWhiteLast", .white = "black last"},
        Stored{.name = "NoWhite", .white = "absent"},
        Stored{.name = "InverseFirst", .inverse_first = true},
        Stored{.name = "NoInverses", .inverses = false},
        Stored{.name = "NeitherInversesNorWhite", .inverses = false, .white = "absent"},
        Stored{.name = "RowsFirst", .rows_first = true},
        Stored{.name = "All", .rows_first = true, .inverse_first = true, .white = "first"},
        Stored{.name = "RowsFirstNoInverses", .rows_first = true, .inverses = false},
        Stored{.name = "ColumnsOnly", .rows = false},
        Stored{.name = "ColumnsOnlyNoInverses", .inverses = false, .rows = false, .white = "first"},
        Stored{.name = "FinestFirst", .finest_first = true},
        Stored{.name = "StepOfTwo", .step_px = 2},
        Stored{.name = "StepOfFourRowsFirst", .rows_first = true, .step_px = 4},
        Stored{.name = "Jpeg", .inverse_first = true, .white = "first", .ending = ".jpg", .quality = 80},
        Stored{.name = "Noise", .rows_first = true, .white = "first", .noise = 4},
        Stored{.name = "CameraOnItsSide", .turned = cv::ROTATE_90_CLOCKWISE},
        Stored{
            .name = "CameraOnItsSideWhiteFirst", .white = "first", .turned = cv::ROTATE_90_COUNTERCLOCKWISE},
        Stored{.name = "CameraUpsideDown", .inverse_first = true, .turned = cv::ROTATE_180},
        Stored{.name = "MirroredProjection", .mirrored = true}),
    [](const auto& info) { return info.param.name; });

TEST(ShotOrder, ThatContradictsTheImagesIsNamed) {
  const Series series = store({.rows_first = true, .inverse_first = true}, test::test_folder());
  for (const char* words : {"columns-first", "inverse-second", "white-first", "finest-first"}) {
    const auto found = find_shot_order({series.files}, 64, 64, KnownOrder::parse(words).value());
    ASSERT_FALSE(found.ok()) << words;
    EXPECT_NE(found.message().find(fmt::format("--order {} does not fit", words)), std::string::npos)
        << found.message();
    EXPECT_NE(found.message().find("each inverse, then its pattern; rows, then columns"), std::string::npos)
        << found.message();
  }
  const auto same =
      find_shot_order({series.files}, 64, 64, KnownOrder::parse("rows-first,inverse-first").value());
  ASSERT_TRUE(same.ok()) << same.message();
  EXPECT_EQ(same->shots, series.places);
}

// The words decide where the images alone do not: a mirrored projection by a camera on its side.
TEST(ShotOrder, IsWhatThePersonSaysWhereBothFit) {
  const Series series = store({.mirrored = true}, test::test_folder());
  const auto found = find_shot_order({series.files}, 64, 64, KnownOrder::parse("rows-first").value());
  ASSERT_TRUE(found.ok()) << found.message();
  EXPECT_EQ(found->order.axes, AxisOrder::rows_columns);
}

TEST(ShotOrder, OfShuffledImagesIsAnError) {
  Series series = store({}, test::test_folder());
  std::shuffle(series.files.begin(), series.files.end(), test::test_rng());
  const auto found = find_shot_order({series.files}, 64, 64);
  ASSERT_FALSE(found.ok());
  EXPECT_NE(found.message().find("the order of the images does not fit"), std::string::npos)
      << found.message();
}

TEST(ShotOrder, OfDarkImagesIsAssumedToBeOpenCvs) {
  const fs::path folder = test::test_folder();
  std::vector<fs::path> files;
  for (int i = 0; i < 26; ++i) {
    files.push_back(folder / image_name(i));
    ASSERT_TRUE(write_png(files.back(), cv::Mat(120, 160, CV_8U, cv::Scalar(7))).ok());
  }
  const auto found = find_shot_order({files}, 64, 64);
  ASSERT_TRUE(found.ok()) << found.message();
  EXPECT_TRUE(found->is_assumed);
  EXPECT_EQ(found->order, ShotOrder());
}

TEST(ShotOrder, WordsThatAreUnknownAreWrongUsage) {
  const auto parsed = KnownOrder::parse("white-first,upside-down");
  ASSERT_FALSE(parsed.ok());
  EXPECT_TRUE(parsed.error().wrong_usage);
  EXPECT_NE(parsed.message().find("upside-down"), std::string::npos);
}

TEST(WhiteAndBlack, AreComputedFromTheSeries) {
  for (const bool inverses : {true, false}) {
    const Series series = store({.inverses = inverses, .white = "absent", .noise = 1},
                                test::test_folder() / (inverses ? "pairs" : "single"));
    const auto made = white_black_of(series.files, inverses);
    ASSERT_TRUE(made.ok()) << made.message();
    EXPECT_LT(cv::mean(cv::abs(made->white - series.photos[24]))[0], 8) << inverses;
    EXPECT_LT(cv::mean(cv::abs(made->black - series.photos[25]))[0], 8) << inverses;
  }
}

// Columns and rows of a code whose finest bits were left out, against where the pixels lie.
TEST(WideSteps, AreDecodedBetweenTheirEdges) {
  for (const int step : {2, 3}) {
    test::CodeBench bench;
    bench.patterns = Patterns::create(PatternCode::gray, 64, 64, {.step_px = step}).value();
    const auto files = bench.photograph(test::test_folder() / std::to_string(step));
    const auto decoded = decode(bench.patterns, files, bench.width, bench.height);
    ASSERT_TRUE(decoded.ok()) << decoded.message();
    double squared = 0;
    int count = 0;
    for (int y = 8; y < bench.height - 8; ++y) {
      for (int x = 8; x < bench.width - 8; ++x) {
        const auto& px = decoded->px_projector.at<cv::Vec2f>(y, x);
        if (std::isnan(px[0])) continue;
        squared += std::pow(px[0] - bench.column_at(x), 2) + std::pow(px[1] - bench.row_at(y), 2);
        ++count;
      }
    }
    EXPECT_GT(count, 0.95 * (bench.width - 16) * (bench.height - 16));
    EXPECT_LT(std::sqrt(squared / count), 0.1) << "step " << step;
  }
}

TEST(ColumnsAlone, AreDecodedWithoutRows) {
  test::CodeBench bench;
  bench.patterns = Patterns::create(PatternCode::gray, 64, 64, {.axes = CodeAxes::columns}).value();
  EXPECT_EQ(bench.patterns.count(), 14);
  const auto files = bench.photograph(test::test_folder());
  const auto decoded = decode(bench.patterns, files, bench.width, bench.height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const auto& px = decoded->px_projector.at<cv::Vec2f>(60, 80);
  EXPECT_NEAR(px[0], bench.column_at(80), 0.1);
  EXPECT_TRUE(std::isnan(px[1]));
  EXPECT_GT(decoded->share(), 0.95);
}

}  // namespace
}  // namespace limn::calib
