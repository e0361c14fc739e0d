#include "calib/code/capture_quality.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calib/code/decode.h"
#include "tests/calib/code_bench.h"

namespace limn::calib {
namespace {

using test::CodeBench;

// A sheet with soft blobs, `moved` to the right by that many camera pixels.
void print_blobs(cv::Mat* light, double moved) {
  for (int y = 0; y < light->rows; ++y) {
    for (int x = 0; x < light->cols; ++x)
      light->at<double>(y, x) *= 0.6 + 0.2 * std::sin((x - moved) / 3.0) + 0.2 * std::cos(y / 3.5);
  }
}

CodeBench bench_with_blobs() {
  CodeBench bench;
  bench.white = 210;
  bench.noise = 1.5;
  bench.changed = [](int, cv::Mat* light) { print_blobs(light, 0); };
  return bench;
}

CaptureQuality quality_of(const CodeBench& bench, const std::vector<cv::Mat>& photos) {
  CaptureQualityProbe probe(bench.patterns, bench.width, bench.height);
  std::vector<std::filesystem::path> files;
  for (int i = 0; i < bench.patterns.count(); ++i) {
    probe.add_image(i, photos[static_cast<size_t>(i)]);
    files.push_back(image_name(i));
  }
  return probe.quality(files);
}

TEST(CaptureQuality, OfASoundSeriesIsUnremarkable) {
  CodeBench bench = bench_with_blobs();
  const CaptureQuality quality = quality_of(bench, bench.photographs());
  EXPECT_EQ(quality.samples, bench.width * bench.height);
  EXPECT_EQ(quality.saturated, 0);
  EXPECT_NEAR(quality.black_level, 20, 0.6);
  EXPECT_NEAR(quality.white_level, 20 + 0.6 * 190, 3);
  EXPECT_EQ(quality.groups.size(), 13U);
  EXPECT_GT(quality.level_low, 0.995);
  EXPECT_LT(quality.level_high, 1.005);
  EXPECT_TRUE(quality.odd.empty());
  EXPECT_GT(quality.shift_patches, 5);
  EXPECT_LT(quality.shift_worst_px, 0.15);
  EXPECT_LT(quality.groups[5].contrast, 0.75) << "the finest columns are blurred";
  EXPECT_GT(quality.groups[0].contrast, 0.9);
}

TEST(CaptureQuality, NamesImagesThatAreRepeatedOrSwapped) {
  CodeBench bench = bench_with_blobs();
  const std::vector<cv::Mat> sound = bench.photographs();
  auto photos = sound;
  const std::vector<cv::Mat> again = bench.photographs();  // the same with other noise
  photos[7] = again[6];                                    // an inverse that was not shown in time
  CaptureQuality quality = quality_of(bench, photos);
  ASSERT_EQ(quality.odd.size(), 1U);
  EXPECT_EQ(quality.odd[0].file, "007.png");
  EXPECT_EQ(quality.odd[0].finding, "shows the same as 006.png");

  photos = sound;
  photos[8] = again[7];  // an image that was not shown in time
  quality = quality_of(bench, photos);
  ASSERT_EQ(quality.odd.size(), 1U);
  EXPECT_EQ(quality.odd[0].file, "008.png");
  EXPECT_EQ(quality.odd[0].finding, "shows the same as 007.png");

  photos = sound;
  std::swap(photos[4], photos[16]);
  quality = quality_of(bench, photos);
  ASSERT_EQ(quality.odd.size(), 2U);
  EXPECT_EQ(quality.odd[0].file, "004.png");
  EXPECT_EQ(quality.odd[0].finding, "or 005.png has changed places with 016.png or 017.png");
  EXPECT_EQ(quality.odd[1].file, "016.png");

  photos = sound;
  photos[25] = again[23];  // black was not shown
  quality = quality_of(bench, photos);
  ASSERT_EQ(quality.odd.size(), 1U);
  EXPECT_EQ(quality.odd[0].file, "025.png");
}

// Half of the light, as a camera with the sRGB curve shows it, is much brighter than half of white.
void encode_srgb(cv::Mat* light) {
  for (int y = 0; y < light->rows; ++y) {
    for (int x = 0; x < light->cols; ++x) {
      double& value = light->at<double>(y, x);
      value = value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055;
    }
  }
}

// A series of which the camera resolves some pairs and not others.
CodeBench blurred_bench(double blur, bool is_srgb) {
  CodeBench bench = bench_with_blobs();
  bench.patterns = Patterns::create(PatternCode::gray, 256, 256).value();
  bench.blur = blur;
  bench.changed = [is_srgb](int, cv::Mat* light) {
    print_blobs(light, 0);
    if (is_srgb) encode_srgb(light);
  };
  return bench;
}

TEST(CaptureQuality, BlurredStripesAreNotRepeatedImages) {
  for (const double blur : {0.6, 0.9, 1.2, 1.6, 2.2}) {
    for (const bool is_srgb : {false, true}) {
      CodeBench bench = blurred_bench(blur, is_srgb);
      const CaptureQuality quality = quality_of(bench, bench.photographs());
      EXPECT_TRUE(quality.odd.empty())
          << blur << is_srgb << ": " << quality.odd.front().file << " " << quality.odd.front().finding;
    }
  }
}

TEST(CaptureQuality, NamesARepeatedImageInABlurredSeries) {
  for (const bool is_srgb : {false, true}) {
    CodeBench bench = blurred_bench(1.6, is_srgb);
    auto photos = bench.photographs();
    const std::vector<cv::Mat> again = bench.photographs();
    photos[7] = again[6];    // an inverse of stripes that are resolved
    photos[16] = again[15];  // the widest rows; the image before it is a blurred grey
    const CaptureQuality quality = quality_of(bench, photos);
    ASSERT_EQ(quality.odd.size(), 2U) << is_srgb;
    EXPECT_EQ(quality.odd[0].file, "007.png");
    EXPECT_EQ(quality.odd[0].finding, "shows the same as 006.png");
    EXPECT_EQ(quality.odd[1].file, "016.png");
    EXPECT_EQ(quality.odd[1].finding, "shows the same as 015.png");
  }
}

TEST(CaptureQuality, ABoardThatOneStripeCoversInADarkNoisyRoomIsSound) {
  CodeBench bench = bench_with_blobs();
  bench.noise = 3;
  bench.changed = [](int, cv::Mat* light) {
    print_blobs(light, 0);
    const cv::Mat board = light->rowRange(20, 50).colRange(20, 60).clone();
    light->setTo(0);
    board.copyTo(light->rowRange(20, 50).colRange(20, 60));
  };
  // White and the widest stripes look alike there; only images that also fail to add up are odd.
  const CaptureQuality quality = quality_of(bench, bench.photographs());
  EXPECT_TRUE(quality.odd.empty()) << quality.odd.front().file << " " << quality.odd.front().finding;
  EXPECT_NEAR(quality.samples, 30 * 40, 30);
}

TEST(CaptureQuality, FollowsTheExposure) {
  CodeBench bench = bench_with_blobs();
  auto photos = bench.photographs();
  for (size_t i = 0; i < photos.size(); ++i)
    photos[i].convertTo(photos[i], CV_8U,
                        1 + 0.1 * static_cast<double>(i) / static_cast<double>(photos.size()));
  const CaptureQuality quality = quality_of(bench, photos);
  EXPECT_NEAR(quality.level_high - quality.level_low, 0.09, 0.01);
  EXPECT_LT(quality.groups[1].level, quality.groups[10].level);
  EXPECT_TRUE(quality.odd.empty());
}

TEST(CaptureQuality, MeasuresHowFarTheSceneMoved) {
  for (const double moved : {0.5, 3.0}) {
    CodeBench bench = bench_with_blobs();
    bench.changed = [moved](int index, cv::Mat* light) { print_blobs(light, index < 12 ? 0 : moved); };
    const CaptureQuality quality = quality_of(bench, bench.photographs());
    EXPECT_NEAR(quality.shift_px, moved, 0.1);
    EXPECT_LT(quality.shift_worst_px, moved + 0.2);
  }
}

TEST(CaptureQuality, CountsSaturatedPixelsAndRoomLight) {
  CodeBench bench = bench_with_blobs();
  bench.black = 90;
  bench.white = 300;
  const CaptureQuality quality = quality_of(bench, bench.photographs());
  EXPECT_NEAR(quality.black_level, 90, 1);
  EXPECT_GT(quality.saturated, 0.1);
  EXPECT_LT(quality.saturated, 0.5);
}

TEST(CaptureQuality, ComesWithWhatIsDecodedAndSaysWhenTheProjectorIsOutOfFocus) {
  CodeBench bench = bench_with_blobs();
  bench.blur = 0.4;
  const auto sharp = decode(bench.patterns, bench.photograph(test::test_folder()), bench.width, bench.height);
  ASSERT_TRUE(sharp.ok()) << sharp.message();
  EXPECT_LT(sharp->quality.unsure_finest, 0.15);
  bench.blur = 1.8;
  const auto soft = decode(bench.patterns, bench.photograph(test::test_folder()), bench.width, bench.height);
  ASSERT_TRUE(soft.ok()) << soft.message();
  EXPECT_GT(soft->quality.unsure_finest, 0.6);
}

}  // namespace
}  // namespace limn::calib
