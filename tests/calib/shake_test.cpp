#include "calib/code/shake.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "calib/code/decode.h"
#include "tests/calib/code_bench.h"

namespace limn::calib {
namespace {

using Eigen::Vector2d;
using test::CodeBench;

// Ink on paper: squares of 12 pixels with blurred edges, displaced.
void print_squares(const Vector2d& shift, cv::Mat* light) {
  const auto edge = [](double at) { return std::tanh(1.5 * 12 / M_PI * std::sin(at * M_PI / 12)); };
  for (int y = 0; y < light->rows; ++y) {
    for (int x = 0; x < light->cols; ++x)
      light->at<double>(y, x) *= 0.65 + 0.35 * edge(x - shift.x() + 3.3) * edge(y - shift.y() + 1.7);
  }
}

// Displacement and gain of every image.
struct Disturbed {
  std::vector<Vector2d> shifts;
  std::vector<double> gains;

  Disturbed(int images, double shake_px, double flicker, std::mt19937_64 rng) {
    std::normal_distribution<double> normal(0, 1);
    for (int i = 0; i < images; ++i) {
      const double x = shake_px * normal(rng), y = shake_px * normal(rng);
      shifts.emplace_back(x, y);
      gains.push_back(1 + flicker * normal(rng));
    }
  }
  Vector2d mean_shift() const {
    Vector2d sum = Vector2d::Zero();
    for (const Vector2d& shift : shifts) sum += shift;
    return sum / static_cast<double>(shifts.size());
  }
};

// `stripes_follow`: the camera vibrates; else the board does, and the stripes stay.
CodeBench bench_of(const Disturbed& disturbed, bool stripes_follow) {
  CodeBench bench;
  bench.blur = 0.5;
  bench.noise = 1;
  if (stripes_follow) {
    bench.shift_px = [disturbed](int i) { return disturbed.shifts[static_cast<size_t>(i)]; };
  }
  bench.changed = [disturbed](int i, cv::Mat* light) {
    print_squares(disturbed.shifts[static_cast<size_t>(i)], light);
    *light *= disturbed.gains[static_cast<size_t>(i)];
  };
  return bench;
}

Decoded decoded_of(CodeBench bench) {
  const auto files = bench.photograph(test::test_folder());
  return decode(bench.patterns, files, bench.width, bench.height).value();
}

// Mean error of the labels against the undisplaced projector, projector pixels.
Vector2d mean_error(const Decoded& decoded, const CodeBench& bench, const Vector2d& shift) {
  Vector2d sum = Vector2d::Zero();
  int count = 0;
  for (int y = 8; y + 8 < bench.height; ++y) {
    for (int x = 8; x + 8 < bench.width; ++x) {
      const auto& label = decoded.px_projector.at<cv::Vec2f>(y, x);
      if (std::isnan(label[0])) continue;
      sum += Vector2d(label[0] - bench.column_at(x - shift.x()), label[1] - bench.row_at(y - shift.y()));
      ++count;
    }
  }
  return sum / std::max(1, count);
}

TEST(Shake, OfAPairIsMeasuredWithinItsStatedDeviation) {
  CodeBench still = bench_of(Disturbed(26, 0, 0, test::test_rng()), true);
  const std::vector<cv::Mat> reference = still.photographs();
  const ShakeReference measured(reference[24], reference[25]);
  const Disturbed disturbed(26, 0.2, 0.015, test::test_rng());
  const std::vector<cv::Mat> photos = bench_of(disturbed, true).photographs();
  for (size_t i = 0; i + 2 < 26; i += 2) {
    const PairShake pair = measured.measure(photos[i], photos[i + 1]);
    const Vector2d shift = (disturbed.shifts[i] + disturbed.shifts[i + 1]) / 2;
    EXPECT_LT((pair.shift_px - shift).norm(), 0.02 + 4 * pair.shift_stddev_px) << i;
    EXPECT_NEAR(pair.gain_difference, disturbed.gains[i] - disturbed.gains[i + 1],
                0.002 + 4 * pair.gain_stddev)
        << i;
    EXPECT_LT(pair.shift_stddev_px, 0.02);
  }
}

TEST(Shake, OfTheCameraIsTakenOutOfTheLabels) {
  double with = 0, without = 0;
  for (int draw = 0; draw < 4; ++draw) {
    std::mt19937_64 rng = test::test_rng();
    rng.discard(static_cast<unsigned>(1000 * draw));
    const Disturbed disturbed(26, 0.2, 0.015, rng);
    const CodeBench bench = bench_of(disturbed, true);
    const Decoded decoded = decoded_of(bench);
    const Shake& shake = decoded.quality.shake;
    EXPECT_TRUE(shake.shakes);
    EXPECT_TRUE(shake.flickers);
    EXPECT_NEAR(shake.share, 1, 0.1);
    EXPECT_NEAR(shake.shift_rms_px, 0.2, 0.08);
    EXPECT_NEAR(shake.gain_rms, 0.015, 0.008);
    const Vector2d mean = disturbed.mean_shift();
    EXPECT_LT((shake.white_shift_px - (disturbed.shifts[24] - mean)).norm(), 0.04);
    with += mean_error(decoded, bench, mean).squaredNorm();
    // What the finest bit's pair alone would do to half of the edges.
    without += std::pow(0.35 * 0.5 * ((disturbed.shifts[10] + disturbed.shifts[11]) / 2 - mean).x(), 2);
  }
  printf("[ shake    ] mean error of the labels %.4f px, of one bit uncorrected %.4f px\n",
         std::sqrt(with / 8), std::sqrt(without / 4));
  EXPECT_LT(std::sqrt(with / 8), 0.008);
}

// The steps of a wave are displaced and differ in their light, too: without a correction the labels are off
// by 0.04 px RMS more than those of a still series.
TEST(Shake, OfTheCameraIsTakenOutOfPhases) {
  const Patterns patterns = Patterns::create(PatternCode::phase, 64, 64, {.gamma = 1}).value();
  const auto is_beside_ink = [](double at) { return std::abs(std::sin(at * M_PI / 12)) < 0.8; };
  const auto error_px = [&](const Disturbed& disturbed) {
    CodeBench bench = bench_of(disturbed, true);
    bench.patterns = patterns;
    const Decoded decoded = decoded_of(bench);
    // Labels are those of the mean of white and the images of bits.
    Vector2d mean = disturbed.shifts[static_cast<size_t>(patterns.white())];
    for (int i = 0; i < patterns.first_step(); ++i) mean += disturbed.shifts[static_cast<size_t>(i)];
    mean /= patterns.first_step() + 1;
    double sum = 0;
    int count = 0;
    for (int y = 8; y + 8 < bench.height; ++y) {
      for (int x = 8; x + 8 < bench.width; ++x) {
        const auto& label = decoded.px_projector.at<cv::Vec2f>(y, x);
        if (std::isnan(label[0]) || is_beside_ink(x + 3.3) || is_beside_ink(y + 1.7)) continue;
        sum += (Vector2d(label[0], label[1]) -
                Vector2d(bench.column_at(x - mean.x()), bench.row_at(y - mean.y())))
                   .squaredNorm();
        ++count;
      }
    }

    EXPECT_GT(count, 1500);
    return std::sqrt(sum / (2 * count));
  };
  const double still = error_px(Disturbed(patterns.count(), 0, 0, test::test_rng()));
  double shaken = 0;
  for (int draw = 0; draw < 3; ++draw) {
    std::mt19937_64 rng = test::test_rng();
    rng.discard(static_cast<unsigned>(1000 * draw));
    shaken += std::pow(error_px(Disturbed(patterns.count(), 0.2, 0.015, rng)), 2) / 3;
  }
  shaken = std::sqrt(shaken);
  printf("[ shake    ] error of phase labels %.4f px, of a still series %.4f px\n", shaken, still);
  EXPECT_LT(std::sqrt(shaken * shaken - still * still), 0.02);
}

TEST(Shake, OfTheBoardLeavesTheLabelsAndMovesTheCorners) {
  const Disturbed disturbed(26, 0.2, 0, test::test_rng());
  const CodeBench bench = bench_of(disturbed, false);
  const Decoded decoded = decoded_of(bench);
  const Shake& shake = decoded.quality.shake;
  EXPECT_TRUE(shake.shakes);
  EXPECT_NEAR(shake.share, 0, 0.1);
  EXPECT_LT((shake.white_shift_px - (disturbed.shifts[24] - disturbed.mean_shift())).norm(), 0.04);
  EXPECT_LT(mean_error(decoded, bench, Vector2d::Zero()).norm(), 0.008);
}

TEST(Shake, IsNotFoundInAStillSeries) {
  for (const double noise : {0.0, 1.0, 3.0}) {
    CodeBench bench = bench_of(Disturbed(26, 0, 0, test::test_rng()), true);
    bench.noise = noise;
    const Shake shake = decoded_of(bench).quality.shake;
    EXPECT_FALSE(shake.shakes) << noise << ": " << shake.shift_rms_px;
    EXPECT_FALSE(shake.flickers) << noise << ": " << shake.gain_rms;
    EXPECT_EQ(shake.white_shift_px, Vector2d(0, 0));
  }
}

TEST(Shake, HidesNoRepeatedImageAndLooksLikeNone) {
  CodeBench bench = bench_of(Disturbed(26, 0.2, 0.015, test::test_rng()), true);
  EXPECT_TRUE(decoded_of(bench).quality.odd.empty());
  const auto files = bench.photograph(test::test_folder());
  std::filesystem::copy_file(files[6], files[7], std::filesystem::copy_options::overwrite_existing);
  const auto decoded = decode(bench.patterns, files, bench.width, bench.height);
  ASSERT_TRUE(decoded.ok()) << decoded.message();
  ASSERT_EQ(decoded->quality.odd.size(), 1U);
  EXPECT_EQ(decoded->quality.odd[0].file.filename(), "007.png");
}

TEST(Shake, OfMoreThanAPixelIsMotion) {
  Disturbed moved(26, 0, 0, test::test_rng());
  for (size_t i = 12; i < 26; ++i) moved.shifts[i] = Vector2d(4, 0);
  const Shake shake = decoded_of(bench_of(moved, true)).quality.shake;
  EXPECT_FALSE(shake.shakes);
}

}  // namespace
}  // namespace limn::calib
