#include "calib/code/patterns.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

TEST(Patterns, CountAsOpenCVDoes) {
  EXPECT_EQ(Patterns::create(PatternCode::gray, 1024, 768)->count(), 42);
  EXPECT_EQ(Patterns::create(PatternCode::gray, 1280, 800)->count(), 44);
  EXPECT_EQ(Patterns::create(PatternCode::gray, 2, 2)->count(), 6);
}

TEST(Patterns, GiveEveryPixelItsOwnCodeInTheStatedOrder) {
  const Patterns patterns = Patterns::create(PatternCode::gray, 13, 6).value();
  const int column_bits = patterns.column_bits(), row_bits = patterns.row_bits();
  ASSERT_EQ(column_bits, 4);
  ASSERT_EQ(row_bits, 3);
  auto value = [&](int first, int bits, int x, int y) {  // Gray to binary, most significant first
    int binary = 0, previous = 0;
    for (int i = 0; i < bits; ++i) {
      const int lit = patterns.image(first + 2 * i).at<uchar>(y, x);
      EXPECT_EQ(lit + patterns.image(first + 2 * i + 1).at<uchar>(y, x), 255);
      previous ^= lit == 255 ? 1 : 0;
      binary = 2 * binary + previous;
    }
    return binary;
  };
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 13; ++x) {
      EXPECT_EQ(value(0, column_bits, x, y), x);
      EXPECT_EQ(value(2 * column_bits, row_bits, x, y), y);
    }
  }
  EXPECT_EQ(patterns.image(patterns.white()).at<uchar>(5, 12), 255);
  EXPECT_EQ(patterns.image(patterns.black()).at<uchar>(5, 12), 0);
  EXPECT_EQ(patterns.white(), 14);
}

TEST(Patterns, ExchangedBitsAreGrayCodeWithNarrowStripes) {
  const Patterns gray = Patterns::create(PatternCode::gray, 64, 32).value();
  for (const int stripe : {2, 4, 8}) {
    const Patterns exchanged =
        Patterns::create(PatternCode::exclusive_or, 64, 32, {.base_stripe_px = stripe}).value();
    ASSERT_EQ(exchanged.count(), gray.count());
    const int base = exchanged.column_bits() - 1 - exchanged.base_bit();  // pair of the base bit
    cv::Mat differing;
    cv::compare(exchanged.image(2 * base), gray.image(2 * base), differing, cv::CMP_NE);
    EXPECT_EQ(cv::countNonZero(differing), 0);
    for (int pair = 0; pair < exchanged.column_bits(); ++pair) {
      const cv::Mat shown = exchanged.image(2 * pair);
      for (int x = 0; x < 64; ++x) {
        const int bit = (gray.image(2 * pair).at<uchar>(0, x) ^
                         (pair < base ? gray.image(2 * base).at<uchar>(0, x) : 0)) != 0;
        ASSERT_EQ(shown.at<uchar>(0, x) != 0, bit) << pair << " " << x;
      }
      int run = 1, longest = 1;
      for (int x = 1; x < 64; ++x) {
        run = shown.at<uchar>(0, x) == shown.at<uchar>(0, x - 1) ? run + 1 : 1;
        longest = std::max(longest, run);
      }
      EXPECT_LE(longest, stripe + stripe / 2) << "pair " << pair;
    }
  }
}

TEST(Patterns, WavesAreSinusoidalInLightAndTheirPairsTellThemApart) {
  const CodeOptions options{.period_px = 20, .steps = 5, .gamma = 1.8};
  const Patterns patterns = Patterns::create(PatternCode::phase, 100, 60, options).value();
  EXPECT_EQ(patterns.lowest_bit(), 3);  // labels of 8 pixels; half a wave is 10
  EXPECT_EQ(patterns.column_bits(), 4);
  EXPECT_EQ(patterns.count(), 2 * (4 + 3) + 2 * 5 + 2);
  EXPECT_EQ(patterns.groups().size(), 7U + 2U + 1U);
  for (int k = 0; k < 5; ++k) {
    const cv::Mat columns = patterns.image(patterns.first_step() + k);
    const cv::Mat rows = patterns.image(patterns.first_step() + 5 + k);
    for (int i = 0; i < 60; ++i) {
      const double light = 0.5 + 0.5 * std::cos(2 * std::numbers::pi * (i / 20.0 - k / 5.0));
      EXPECT_NEAR(std::pow(columns.at<uchar>(7, i) / 255.0, 1.8), light, 0.005);
      EXPECT_EQ(rows.at<uchar>(i, 3), columns.at<uchar>(7, i));
    }
  }
}

TEST(Patterns, WithoutInversesAreEverySecondImageOfThoseWith) {
  for (const PatternCode code : {PatternCode::gray, PatternCode::exclusive_or}) {
    const Patterns all = Patterns::create(code, 60, 40).value();
    const Patterns sparse = Patterns::create(code, 60, 40, {.inverses = false}).value();
    ASSERT_EQ(2 * sparse.first_step(), all.first_step());
    for (int i = 0; i < sparse.first_step(); ++i)
      EXPECT_EQ(cv::norm(sparse.image(i), all.image(2 * i), cv::NORM_INF), 0) << to_text(code) << i;
    EXPECT_EQ(cv::countNonZero(sparse.image(sparse.black())), 0);
    EXPECT_EQ(sparse.groups().size(), 1U);
    const auto path = test::test_folder() / "patterns.json";
    ASSERT_TRUE(save_patterns(sparse, path).ok());
    EXPECT_EQ(load_patterns(path).value(), sparse);
  }
}

TEST(Patterns, WavesOfAMeasuredResponseAreSinusoidalInEveryChannel) {
  ProjectorResponse response{"left", {}, {}, {}};
  for (int v = 0; v < 200; ++v) {
    response.red.push_back(0.01 + 0.99 * std::pow(v / 199.0, 2.6));
    response.green.push_back(0.01 + 0.99 * std::pow(v / 199.0, 1.4));
    response.blue.push_back(0.01 + 0.8 * v / 199.0);
  }
  const Patterns plain = Patterns::create(PatternCode::phase, 64, 32).value();
  const Patterns patterns = linearised(plain, {response}, "left").value();
  ASSERT_EQ(patterns.image(patterns.first_step()).type(), CV_8UC3);
  for (int k = 0; k < 6; ++k) {
    const cv::Mat columns = patterns.image(patterns.first_step() + k);
    const cv::Mat rows = patterns.image(patterns.first_step() + 6 + k);
    for (int i = 0; i < 32; ++i) {
      const double light = 0.5 + 0.5 * std::cos(2 * std::numbers::pi * (i / 16.0 - k / 6.0));
      const auto& bgr = columns.at<cv::Vec3b>(7, i);
      EXPECT_NEAR(lookup(response.blue, bgr[0] / 255.0), 0.01 + 0.8 * light, 0.005);
      EXPECT_NEAR(lookup(response.green, bgr[1] / 255.0), 0.01 + 0.99 * light, 0.005);
      EXPECT_NEAR(lookup(response.red, bgr[2] / 255.0), 0.01 + 0.99 * light, 0.006);
      EXPECT_EQ(rows.at<cv::Vec3b>(i, 3), bgr);
    }
  }
  EXPECT_NE(linearised(plain, {response}, "right").message().find("right, found those of left"),
            std::string::npos);
  const Patterns gray = Patterns::create(PatternCode::gray, 64, 32).value();
  EXPECT_EQ(linearised(gray, {response}, "right").value(), gray);
  const auto path = test::test_folder() / "patterns.json";
  ASSERT_TRUE(save_patterns(patterns, path).ok());
  const auto read = load_patterns(path);
  ASSERT_TRUE(read.ok()) << read.message();
  EXPECT_EQ(*read, patterns);
}

TEST(Patterns, SurviveTheirFile) {
  const auto path = test::test_folder() / "patterns.json";
  for (const auto& [code, options] : {std::pair<PatternCode, CodeOptions>{PatternCode::gray, {}},
                                      {PatternCode::phase, {.period_px = 24, .steps = 8, .gamma = 1.7}},
                                      {PatternCode::exclusive_or, {.base_stripe_px = 2}}}) {
    const Patterns patterns = Patterns::create(code, 1280, 800, options).value();
    ASSERT_TRUE(save_patterns(patterns, path).ok());
    const auto read = load_patterns(path);
    ASSERT_TRUE(read.ok()) << read.message();
    EXPECT_EQ(*read, patterns);
  }
}

TEST(Patterns, SayWhatIsWrong) {
  EXPECT_NE(Patterns::create(PatternCode::phase, 640, 480, {.period_px = 3}).message().find("3"),
            std::string::npos);
  EXPECT_FALSE(Patterns::create(PatternCode::phase, 640, 480, {.steps = 2}).ok());
  EXPECT_FALSE(Patterns::create(PatternCode::phase, 640, 480, {.gamma = 0}).ok());
  CodeOptions falling;
  falling.response = DisplayCurves{{0, 1}, {0, 1}, {1, 0}};
  EXPECT_FALSE(Patterns::create(PatternCode::phase, 640, 480, falling).ok());
  EXPECT_FALSE(Patterns::create(PatternCode::exclusive_or, 640, 480, {.base_stripe_px = 3}).ok());
  EXPECT_FALSE(Patterns::create(PatternCode::gray, 1, 480).ok());
  EXPECT_FALSE(Patterns::create(PatternCode::gray, 640, 100000).ok());
  const auto path = test::test_folder() / "patterns.json";
  const std::string start =
      R"({"schema": "limn.patterns/1", "code": "gray", "size": [640, 480], "pictures": )";
  ASSERT_TRUE(write_file(path, start + "41}").ok());
  EXPECT_NE(load_patterns(path).message().find("expected 40"), std::string::npos)
      << load_patterns(path).message();
  ASSERT_TRUE(write_file(path, start + R"(40, "colour": 1})").ok());
  EXPECT_NE(load_patterns(path).message().find("colour"), std::string::npos);
  ASSERT_TRUE(
      write_file(path, R"({"schema": "limn.patterns/1", "code": "grey", "size": [8, 8], "pictures": 1})")
          .ok());
  EXPECT_NE(load_patterns(path).message().find("expected one of gray"), std::string::npos);
}

}  // namespace
}  // namespace limn::calib
