#include "calib/decode.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <random>

#include "core/file.h"
#include "core/picture.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

constexpr int k_width = 160, k_height = 120;

// Where in the projector's picture the middle of a camera pixel falls.
double column_at(int x) { return 5.3 + 0.35 * x; }
double row_at(int y) { return 3.1 + 0.4 * y; }

// A camera of k_width x k_height before a projector of 64 x 64.
struct Bench {
  Patterns patterns = Patterns::create("gray", 64, 64).value();
  double white = 180, black = 20;
  double blur = 0.3;  // of the projector, its pixels, standard deviation
  double noise = 0;
  std::mt19937_64 rng = test::test_rng();

  // Light at a place between the projector's pixels: the picture's pixels are squares, blurred.
  double light(const cv::Mat& picture, double u, double v) const {
    double sum = 0, total = 0;
    for (int y = static_cast<int>(v) - 4; y <= static_cast<int>(v) + 5; ++y) {
      for (int x = static_cast<int>(u) - 4; x <= static_cast<int>(u) + 5; ++x) {
        const auto edge = [&](double d) { return 0.5 * (1 + std::erf(d / (blur * std::sqrt(2.0)))); };
        const double weight =
            (edge(x + 0.5 - u) - edge(x - 0.5 - u)) * (edge(y + 0.5 - v) - edge(y - 0.5 - v));
        const bool inside = x >= 0 && y >= 0 && x < picture.cols && y < picture.rows;
        sum += inside ? weight * picture.at<uchar>(y, x) / 255.0 : 0;
        total += weight;
      }
    }
    return total > 0 ? sum / total : 0;
  }

  std::vector<fs::path> photograph(const fs::path& folder) {
    EXPECT_TRUE(make_folder(folder).ok());
    std::normal_distribution<double> scatter(0, 1);
    std::vector<fs::path> files;
    for (int i = 0; i < patterns.count(); ++i) {
      const cv::Mat picture = patterns.picture(i);
      cv::Mat photo(k_height, k_width, CV_8U);
      for (int y = 0; y < k_height; ++y) {
        for (int x = 0; x < k_width; ++x) {
          const double level = black + (white - black) * light(picture, column_at(x), row_at(y));
          photo.at<uchar>(y, x) = cv::saturate_cast<uchar>(level + noise * scatter(rng));
        }
      }
      files.push_back(folder / picture_name(i));
      EXPECT_TRUE(write_png(files.back(), photo).ok());
    }
    return files;
  }
};

// Errors of the labels against the truth.
struct Errors {
  double mean = 0, rms = 0, worst = 0, squared_pull = 0;
  int count = 0;
};
Errors errors_of(const Decoded& decoded) {
  Errors e;
  for (int y = 0; y < k_height; ++y) {
    for (int x = 0; x < k_width; ++x) {
      const auto& label = decoded.px_projector.at<cv::Vec2f>(y, x);
      if (std::isnan(label[0])) continue;
      const double du = label[0] - column_at(x), dv = label[1] - row_at(y);
      const auto& variance = decoded.variance.at<cv::Vec2f>(y, x);
      e.mean += du + dv;
      e.rms += du * du + dv * dv;
      e.squared_pull += (du * du / variance[0] + dv * dv / variance[1]) / 2;
      e.worst = std::max({e.worst, std::abs(du), std::abs(dv)});
      ++e.count;
    }
  }
  e.mean /= 2 * e.count;
  e.rms = std::sqrt(e.rms / (2 * e.count));
  e.squared_pull /= e.count;
  return e;
}

TEST(Decode, LabelsEverySharpPixelWithinHalfAProjectorPixel) {
  Bench bench;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded);
  EXPECT_EQ(decoded->lit, k_width * k_height);
  EXPECT_GT(decoded->share(), 0.99);
  EXPECT_LT(e.worst, 0.56);
  EXPECT_LT(std::abs(e.mean), 0.01);
  EXPECT_LT(e.rms, 0.3);
  EXPECT_EQ(decoded->outliers, 0);
}

TEST(Decode, DropsUnresolvedFineBitsInsteadOfThePixel) {
  Bench bench;
  bench.blur = 1.6;  // single-pixel stripes are gone: 1 - 2 exp(-2 pi^2 s^2 / 16) of them
  bench.noise = 1.5;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded);
  EXPECT_GT(decoded->share(), 0.8);
  EXPECT_LT(std::abs(e.mean), 0.05);
  EXPECT_LT(e.worst, 4.0);
  EXPECT_LT(e.squared_pull, 1.3);  // the variance says how coarse the labels are
  double coarse = 0;
  for (int y = 0; y < k_height; ++y) {
    for (int x = 0; x < k_width; ++x) coarse += decoded->variance.at<cv::Vec2f>(y, x)[0] > 0.3 ? 1 : 0;
  }
  EXPECT_GT(coarse / (k_width * k_height), 0.03);  // most lie between two edges, and are finer
}

TEST(Decode, FindsPlacesBetweenWholePixelsAndTheirScatter) {
  Bench bench;
  bench.blur = 0.6;
  bench.noise = 1.5;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded);
  EXPECT_LT(e.rms, 0.05) << "whole pixels scatter by 0.29";
  EXPECT_LT(std::abs(e.mean), 0.005);
  EXPECT_GT(e.squared_pull, 0.3);
  EXPECT_LT(e.squared_pull, 1.5);
  printf("[ sub-pixel] rms %.4f px, squared pull %.2f\n", e.rms, e.squared_pull);
}

// Light from elsewhere lifts every picture by half of what white gains: bits must not look unsure for it.
TEST(Decode, DoesNotMindGlobalLight) {
  Bench bench;
  bench.blur = 0.6;
  bench.noise = 1.0;
  const auto files = bench.photograph(test::test_folder());
  const double global = 60;
  for (int i = 0; i < bench.patterns.count(); ++i) {
    const double share = i == bench.patterns.white() ? 1 : i == bench.patterns.black() ? 0 : 0.5;
    cv::Mat photo = read_picture(files[static_cast<size_t>(i)]).value();
    photo.convertTo(photo, CV_8U, 0.2, share * global);  // 32 levels of direct light remain
    ASSERT_TRUE(write_png(files[static_cast<size_t>(i)], photo).ok());
  }
  const auto decoded = decode(bench.patterns, files, k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded);
  EXPECT_GT(decoded->share(), 0.97);
  EXPECT_LT(e.rms, 0.2);
}

// A wall that the projector's light reaches by way of the room alone sees the mean of each pattern.
TEST(Decode, CallsPixelsUnlitThatReflectionsAloneReach) {
  Bench bench;
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(make_folder(folder).ok());
  std::mt19937_64 rng = test::test_rng();
  std::normal_distribution<double> scatter(0, 1);
  std::vector<fs::path> files;
  for (int i = 0; i < bench.patterns.count(); ++i) {
    const double mean = cv::mean(bench.patterns.picture(i))[0] / 255;
    cv::Mat photo(k_height, k_width, CV_8U);
    for (int y = 0; y < k_height; ++y) {
      for (int x = 0; x < k_width; ++x)
        photo.at<uchar>(y, x) = cv::saturate_cast<uchar>(20 + 60 * mean + scatter(rng));
    }
    files.push_back(folder / picture_name(i));
    ASSERT_TRUE(write_png(files.back(), photo).ok());
  }
  const auto decoded = decode(bench.patterns, files, k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  EXPECT_EQ(decoded->lit, 0);
}

TEST(Decode, SurvivesNoiseAtLowContrast) {
  Bench bench;
  bench.black = 10;
  bench.white = 40;
  bench.noise = 1.5;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded);
  EXPECT_GT(decoded->share(), 0.9);
  EXPECT_LT(e.worst, 3.5);
  EXPECT_LT(e.rms, 0.4);
}

TEST(Decode, LeavesUnlitPixelsAlone) {
  Bench bench;
  bench.white = bench.black + 5;
  bench.noise = 0.5;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  EXPECT_EQ(decoded->lit, 0);
  EXPECT_EQ(decoded->decoded, 0);
}

TEST(Decode, RemovesALabelThatItsNeighboursContradict) {
  Bench bench;
  const auto files = bench.photograph(test::test_folder());
  for (const size_t pair : {0U, 1U}) {  // one pixel reads the coarsest column bit the wrong way
    cv::Mat photo = read_picture(files[pair]).value();
    photo.at<uchar>(60, 30) = pair == 0 ? 180 : 20;
    ASSERT_TRUE(write_png(files[pair], photo).ok());
  }
  const auto decoded = decode(bench.patterns, files, k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  EXPECT_EQ(decoded->outliers, 1);
  EXPECT_TRUE(std::isnan(decoded->px_projector.at<cv::Vec2f>(60, 30)[0]));
}

TEST(Decode, NamesTheFileThatIsMissingDamagedOrOfAnotherSize) {
  Bench bench;
  const fs::path folder = test::test_folder();
  const auto files = bench.photograph(folder);
  const auto message = [&] { return decode(bench.patterns, files, k_width, k_height); };
  const std::string content = read_file(files[5]).value();

  ASSERT_TRUE(write_file(files[5], content.substr(0, content.size() / 2)).ok());
  auto result = message();
  ASSERT_FALSE(result.ok());
  EXPECT_NE(result.message().find("005.png"), std::string::npos) << result.message();

  ASSERT_TRUE(write_png(files[5], cv::Mat(10, 20, CV_8U, cv::Scalar(0))).ok());
  result = message();
  ASSERT_FALSE(result.ok());
  EXPECT_NE(result.message().find("005.png"), std::string::npos) << result.message();
  EXPECT_NE(result.message().find("20x10"), std::string::npos) << result.message();

  fs::remove(files[5]);
  result = message();
  ASSERT_FALSE(result.ok());
  EXPECT_NE(result.message().find("005.png"), std::string::npos) << result.message();
}

}  // namespace
}  // namespace limn::calib
