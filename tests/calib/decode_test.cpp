#include "calib/code/decode.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <random>

#include "core/file.h"
#include "core/image_io.h"
#include "tests/calib/code_bench.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

constexpr int k_width = 160, k_height = 120;
using Bench = test::CodeBench;

// Errors of the labels against the truth.
struct Errors {
  double mean = 0, rms = 0, worst = 0, squared_pull = 0, within_95 = 0;
  int count = 0;
};
Errors errors_of(const Decoded& decoded, const Bench& bench) {
  Errors e;
  for (int y = 0; y < k_height; ++y) {
    for (int x = 0; x < k_width; ++x) {
      const auto& label = decoded.px_projector.at<cv::Vec2f>(y, x);
      if (std::isnan(label[0])) continue;
      const double du = label[0] - bench.column_at(x), dv = label[1] - bench.row_at(y);
      const auto& variance = decoded.variance.at<cv::Vec2f>(y, x);
      e.mean += du + dv;
      e.rms += du * du + dv * dv;
      e.squared_pull += (du * du / variance[0] + dv * dv / variance[1]) / 2;
      for (const double pull : {du / std::sqrt(variance[0]), dv / std::sqrt(variance[1])})
        e.within_95 += std::abs(pull) < 1.96 ? 0.5 : 0;
      e.worst = std::max({e.worst, std::abs(du), std::abs(dv)});
      ++e.count;
    }
  }
  e.mean /= 2 * e.count;
  e.rms = std::sqrt(e.rms / (2 * e.count));
  e.squared_pull /= e.count;
  e.within_95 /= e.count;
  return e;
}

TEST(Decode, LabelsEverySharpPixelWithinHalfAProjectorPixel) {
  Bench bench;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded, bench);
  EXPECT_EQ(decoded->lit, k_width * k_height);
  EXPECT_GT(decoded->share(), 0.99);
  EXPECT_LT(e.worst, 0.56);
  EXPECT_LT(std::abs(e.mean), 0.01);
  EXPECT_LT(e.rms, 0.3);
  EXPECT_EQ(decoded->outliers, 0);
}

TEST(Decode, DropsUnresolvedFineBitsInsteadOfThePixel) {
  Bench bench;
  bench.blur = 1.6;  // single-pixel stripes lose 1 - 2 exp(-2 pi^2 s^2 / 16) of their contrast
  bench.noise = 1.5;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded, bench);
  EXPECT_GT(decoded->share(), 0.8);
  EXPECT_LT(std::abs(e.mean), 0.05);
  EXPECT_LT(e.worst, 4.0);
  EXPECT_LT(e.squared_pull, 1.3);  // the variance states how coarse the labels are
  EXPECT_GT(decoded->quality.unsure_finest, 0.5) << "most pixels have lost their finest bit";
}

// Noise is the only cause of scatter, so the variances must be neither too small nor too large, and the
// measured noise must be that of the images.
TEST(Decode, FindsPlacesBetweenWholePixelsWithTheScatterThatItStates) {
  struct Case {
    PatternCode code;
    CodeOptions options;
    double worst_rms;
  };
  for (const Case& c : {Case{PatternCode::gray, {}, 0.06}, Case{PatternCode::phase, {}, 0.12},
                        Case{PatternCode::exclusive_or, {}, 0.15},
                        Case{PatternCode::exclusive_or, {.base_stripe_px = 2}, 0.29}}) {
    Bench bench;
    bench.patterns = Patterns::create(c.code, 64, 64, c.options).value();
    bench.blur = 0.6;
    bench.noise = 3;
    bench.gamma = bench.patterns.code == PatternCode::phase ? 2.2 : 1;
    const auto decoded =
        decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height, {.floor_px = 0});
    ASSERT_TRUE(decoded.ok()) << decoded.message();
    const Errors e = errors_of(*decoded, bench);
    printf(
        "[ sub-pixel] %-5s %d: rms %.4f px, worst %.3f px, squared normalised error %.2f, %.1f %% within "
        "1.96, noise "
        "%.2f\n",
        to_text(c.code).c_str(), c.options.base_stripe_px, e.rms, e.worst, e.squared_pull, 100 * e.within_95,
        std::sqrt(decoded->quality.noise.read + 100 * decoded->quality.noise.per_level));
    EXPECT_GT(decoded->share(), 0.98) << to_text(c.code);
    EXPECT_LT(e.rms, c.worst_rms) << to_text(c.code) << ": whole pixels scatter by 0.29";
    EXPECT_LT(std::abs(e.mean), 0.01) << to_text(c.code);
    EXPECT_GT(e.squared_pull, 0.7) << to_text(c.code);
    EXPECT_LT(e.squared_pull, 1.3) << to_text(c.code);
    EXPECT_GT(e.within_95, 0.92) << to_text(c.code);
    EXPECT_LT(e.within_95, 0.98) << to_text(c.code);
    EXPECT_NEAR(std::sqrt(decoded->quality.noise.read + 100 * decoded->quality.noise.per_level), 3, 0.2)
        << to_text(c.code);
  }
}

TEST(Decode, WhiteAndBlackStandForInversesThatAreNotShown) {
  for (const PatternCode code : {PatternCode::gray, PatternCode::exclusive_or}) {
    Bench bench;
    bench.patterns = Patterns::create(code, 64, 64, {.inverses = false}).value();
    ASSERT_EQ(bench.patterns.count(), 6 + 6 + 2);
    bench.blur = 0.6;
    bench.noise = 1.5;
    const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
    ASSERT_TRUE(decoded.ok()) << decoded.message();
    const Errors e = errors_of(*decoded, bench);
    EXPECT_GT(decoded->share(), 0.97) << to_text(code);
    EXPECT_LT(e.rms, 0.15) << to_text(code);
    EXPECT_LT(std::abs(e.mean), 0.01) << to_text(code);
    EXPECT_GT(e.squared_pull, 0.6) << to_text(code);
    EXPECT_LT(e.squared_pull, 1.4) << to_text(code);
    EXPECT_TRUE(decoded->quality.odd.empty()) << to_text(code);
  }
}

// An error of half a period would be 8 pixels.
TEST(Decode, PhaseNeverTakesTheNextWave) {
  for (const double blur : {0.3, 1.6, 2.5}) {
    Bench bench;
    bench.patterns = Patterns::create(PatternCode::phase, 64, 64).value();
    bench.blur = blur;
    bench.noise = 3;
    bench.gamma = 2.2;
    const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
    ASSERT_TRUE(decoded.ok()) << decoded.message();
    const Errors e = errors_of(*decoded, bench);
    EXPECT_GT(decoded->share(), 0.97) << blur;
    EXPECT_LT(e.worst, 1) << blur;
    EXPECT_LT(e.rms, 0.15) << blur;
    EXPECT_NEAR(decoded->quality.wave_level, 0.5, 0.02);
  }
}

TEST(Decode, PhaseSaysThatTheProjectorsResponseIsNotWhatItWasDrawnFor) {
  Bench bench;
  bench.patterns = Patterns::create(PatternCode::phase, 64, 64, {.steps = 4, .gamma = 2.2}).value();
  bench.blur = 0.6;
  bench.gamma = 1;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  EXPECT_GT(decoded->quality.wave_level, 0.6);
}

// 3 steps, because every additional step cancels another harmonic of a wrong response.
TEST(Decode, PhaseErrsATenthAsMuchWhenItsWavesAreDrawnByTheProjectorsResponse) {
  Bench bench;
  bench.blur = 0.6;
  bench.gamma = 1.5;
  bench.channel_gamma = {0.85, 1, 1.25};
  ProjectorResponse measured{"projector0", {}, {}, {}};
  for (int v = 0; v < 256; ++v) {
    const auto light = [&](size_t c) { return std::pow(v / 255.0, bench.gamma * bench.channel_gamma[c]); };
    measured.blue.push_back(light(0));
    measured.green.push_back(light(1));
    measured.red.push_back(light(2));
  }
  const auto found = [&](const Patterns& patterns) {
    bench.patterns = patterns;
    return decode(patterns, bench.photograph(test::test_folder()), k_width, k_height).value();
  };
  const Patterns plain = Patterns::create(PatternCode::phase, 64, 64, {.steps = 3}).value();
  const Decoded without = found(plain), with = found(linearised(plain, {measured}, "projector0").value());
  bench.patterns = plain;
  const Errors e_without = errors_of(without, bench), e = errors_of(with, bench);
  printf("[ response ] phase of 3 steps: rms %.3f px with gamma 2.2, %.3f px with the response\n",
         e_without.rms, e.rms);
  EXPECT_NEAR(with.quality.wave_level, 0.5, 0.01);
  EXPECT_GT(without.quality.wave_level, 0.55);
  EXPECT_LT(e.rms, 0.1 * e_without.rms);
  EXPECT_LT(e.rms, 0.02);
}

// A white V-groove of 60 degrees whose crease runs down the middle of the image; light falls at a grazing
// angle on its left wall. Each wall illuminates the other: diffuse, three bounces, strips along the crease
// (the form factor between strips at distances s and t from the crease is s t sin^2 / (2 r^3)), spread along
// them.
class Groove {
 public:
  Groove() : across_(k_width, k_width, CV_64F, cv::Scalar(0)), along_(k_height, k_height, CV_64F) {
    constexpr double k_sine = 0.866, k_cosine = 0.5, k_albedo = 0.9, k_spread_px = 25;
    for (int x = 0; x < k_width; ++x) {
      for (int z = 0; z < k_width; ++z) {
        const double s = std::abs(x - k_crease), t = std::abs(z - k_crease);
        const double r = std::sqrt(s * s + t * t - 2 * s * t * k_cosine);
        if ((x < k_crease) != (z < k_crease))
          across_.at<double>(x, z) = k_albedo * s * t * k_sine * k_sine / (2 * r * r * r);
      }
    }
    for (int y = 0; y < k_height; ++y) {
      for (int z = 0; z < k_height; ++z)
        along_.at<double>(y, z) = std::exp(-(y - z) * (y - z) / (2 * k_spread_px * k_spread_px));
      along_.row(y) /= cv::sum(along_.row(y))[0];
    }
  }
  void operator()(cv::Mat* light) const {
    light->colRange(0, k_crease_column) *= k_flat;
    const cv::Mat direct = light->clone();
    for (int bounce = 0; bounce < 3; ++bounce) *light = direct + along_ * *light * across_.t();
  }
  static constexpr double k_crease = 79.5;
  static constexpr int k_crease_column = 80;
  static constexpr int k_scored = 60;  // nearer to the crease, light goes back and forth within a stripe

 private:
  static constexpr double k_flat = 0.2;  // cosine of incidence as a share of the other wall's
  cv::Mat across_, along_;
};

// Share of the left wall's pixels whose coordinates are right, and share of those that have coordinates.
struct WallScore {
  double right = 0, labelled = 0;
};
WallScore left_wall(PatternCode code, const CodeOptions& options) {
  Bench bench;
  bench.patterns = Patterns::create(code, 64, 64, options).value();
  bench.blur = 0.6;
  bench.noise = 1;
  bench.white = 170;
  const Groove groove;
  bench.changed = [&](int, cv::Mat* light) { groove(light); };
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  EXPECT_TRUE(decoded.ok()) << decoded.message();
  WallScore score;
  for (int y = 0; y < k_height; ++y) {
    for (int x = 0; x < Groove::k_scored; ++x) {
      const auto& px = decoded->px_projector.at<cv::Vec2f>(y, x);
      if (std::isnan(px[0])) continue;
      score.labelled += 1.0 / (k_height * Groove::k_scored);
      if (std::abs(px[0] - bench.column_at(x)) < 1 && std::abs(px[1] - bench.row_at(y)) < 1)
        score.right += 1.0 / (k_height * Groove::k_scored);
    }
  }
  return score;
}

TEST(Decode, XorHoldsInAGrooveWhoseWallsLightEachOtherAndGrayDoesNot) {
  const WallScore gray = left_wall(PatternCode::gray, {}), xor4 = left_wall(PatternCode::exclusive_or, {}),
                  xor2 = left_wall(PatternCode::exclusive_or, {.base_stripe_px = 2});
  printf("[ groove   ] right / labelled: gray %.3f / %.3f, xor 4 px %.3f / %.3f, xor 2 px %.3f / %.3f\n",
         gray.right, gray.labelled, xor4.right, xor4.labelled, xor2.right, xor2.labelled);
  EXPECT_LT(gray.right, 0.5);
  EXPECT_GT(xor4.right, 0.9);
  EXPECT_GT(xor2.right, 0.8) << "stripes of 2 pixels lose more of the dim wall to blur";
  for (const WallScore& score : {xor4, xor2}) EXPECT_GT(score.right, 0.98 * score.labelled);
}

// Indirect light brightens every image by half of what white gains: bits must not look unsure because of it.
TEST(Decode, DoesNotMindGlobalLight) {
  Bench bench;
  bench.blur = 0.6;
  bench.noise = 1.0;
  const auto files = bench.photograph(test::test_folder());
  const double global = 60;
  for (int i = 0; i < bench.patterns.count(); ++i) {
    const double share = i == bench.patterns.white() ? 1 : i == bench.patterns.black() ? 0 : 0.5;
    cv::Mat photo = read_image(files[static_cast<size_t>(i)]).value();
    photo.convertTo(photo, CV_8U, 0.2, share * global);  // 32 levels of direct light remain
    ASSERT_TRUE(write_png(files[static_cast<size_t>(i)], photo).ok());
  }
  const auto decoded = decode(bench.patterns, files, k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded, bench);
  EXPECT_GT(decoded->share(), 0.97);
  EXPECT_LT(e.rms, 0.2);
}

// A wall that the projector's light reaches only by the room sees the mean of each pattern.
TEST(Decode, CallsPixelsUnlitThatReflectionsAloneReach) {
  Bench bench;
  const fs::path folder = test::test_folder();
  ASSERT_TRUE(make_folder(folder).ok());
  std::mt19937_64 rng = test::test_rng();
  std::normal_distribution<double> scatter(0, 1);
  std::vector<fs::path> files;
  for (int i = 0; i < bench.patterns.count(); ++i) {
    const double mean = cv::mean(bench.patterns.image(i))[0] / 255;
    cv::Mat photo(k_height, k_width, CV_8U);
    for (int y = 0; y < k_height; ++y) {
      for (int x = 0; x < k_width; ++x)
        photo.at<uchar>(y, x) = cv::saturate_cast<uchar>(20 + 60 * mean + scatter(rng));
    }
    files.push_back(folder / image_name(i));
    ASSERT_TRUE(write_png(files.back(), photo).ok());
  }
  const auto decoded = decode(bench.patterns, files, k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  EXPECT_EQ(decoded->lit, 0);
}

// 12 bits at the low end of 16: black alone looks like 10 bits, but white decides for the whole series.
TEST(Decode, ASeriesOf12BitsIsDecodedLikeOneOf8) {
  Bench bench;
  bench.noise = 1.0;
  const auto files = bench.photograph(test::test_folder());
  const auto expected = decode(bench.patterns, files, k_width, k_height);
  ASSERT_TRUE(expected.ok()) << expected.message();
  for (const fs::path& file : files) {
    cv::Mat deep;
    read_image(file).value().convertTo(deep, CV_16U, 16, 5);
    ASSERT_TRUE(write_png(file, deep).ok());
  }
  ASSERT_EQ(find_used_bits(files[static_cast<size_t>(bench.patterns.black())]).value(), 10);
  const auto decoded = decode(bench.patterns, files, k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  EXPECT_EQ(decoded->decoded, expected->decoded);
  EXPECT_EQ(cv::norm(decoded->contrast, expected->contrast, cv::NORM_INF), 0);
}

TEST(Decode, SurvivesNoiseAtLowContrast) {
  Bench bench;
  bench.black = 10;
  bench.white = 40;
  bench.noise = 1.5;
  const auto decoded = decode(bench.patterns, bench.photograph(test::test_folder()), k_width, k_height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  const Errors e = errors_of(*decoded, bench);
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
  for (const size_t pair : {0U, 1U}) {  // one pixel reads the coarsest column bit wrong
    cv::Mat photo = read_image(files[pair]).value();
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
