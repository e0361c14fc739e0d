#include "calib/code/phase_import.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "calib/code/decode.h"
#include "calib/foreign_phase.h"
#include "core/file.h"
#include "core/image_io.h"
#include "tests/calib/code_bench.h"
#include "tests/support/matchers.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

// Writes what the bench's camera sees of another program's waves: straight lines of projector coordinates.
struct WaveBench {
  PhaseSeries series;
  double noise = 0;
  test::CodeBench bench;  // its places and size
  static constexpr int k_width = 64, k_height = 48;

  std::vector<fs::path> photograph(const fs::path& folder) {
    EXPECT_TRUE(make_folder(folder).ok());
    files_.clear();
    folder_ = folder;
    if (series.white == WhitePlace::white_black_first) add_white();
    if (series.axes == AxisOrder::columns_rows) add_axis(true);
    add_axis(false);
    if (series.axes == AxisOrder::rows_columns) add_axis(true);
    if (series.white == WhitePlace::white_black_last) add_white();
    return files_;
  }

 private:
  void add_white() {
    add([](double, double) { return 1.0; });
    add([](double, double) { return 0.0; });
  }
  void add_axis(bool columns) {
    const auto& periods = columns || series.row_periods.empty() ? series.column_periods : series.row_periods;
    const int waves = static_cast<int>(std::ceil((columns ? k_width : k_height) / periods[0]));
    for (int bit = bits_for(waves) - 1; series.is_cued && bit >= 0; --bit) {
      for (const bool inverse : {series.cue_inverses == InversePlace::first, true}) {
        add([&](double u, double v) {
          const int wave = static_cast<int>(std::floor((columns ? u : v) / periods[0]));
          const bool lit = ((wave ^ (wave >> 1)) >> bit & 1) != 0;
          return lit != inverse ? 1.0 : 0.0;
        });
        if (series.cue_inverses == InversePlace::none) break;
        if (series.cue_inverses == InversePlace::first && inverse) {
          add([&](double u, double v) {
            const int wave = static_cast<int>(std::floor((columns ? u : v) / periods[0]));
            return ((wave ^ (wave >> 1)) >> bit & 1) != 0 ? 1.0 : 0.0;
          });
          break;
        }
      }
    }
    for (const double period : periods) {
      for (int k = 0; k < series.steps; ++k) {
        const double step = (series.is_backward ? 1.0 : -1.0) * k / series.steps;
        add([&](double u, double v) {
          const double angle = 2 * std::numbers::pi * ((columns ? u : v) / period + step);
          switch (series.wave) {
            case WaveForm::cosine:
              return 0.5 + 0.5 * std::cos(angle);
            case WaveForm::sine:
              return 0.5 + 0.5 * std::sin(angle);
            case WaveForm::minus_cosine:
              return 0.5 - 0.5 * std::cos(angle);
            case WaveForm::minus_sine:
              return 0.5 - 0.5 * std::sin(angle);
          }
          return 0.0;
        });
      }
    }
  }
  void add(const std::function<double(double, double)>& light) {
    std::normal_distribution<double> scatter(0, 1);
    cv::Mat photo(bench.height, bench.width, CV_8U);
    for (int y = 0; y < bench.height; ++y) {
      for (int x = 0; x < bench.width; ++x)
        photo.at<uchar>(y, x) = cv::saturate_cast<uchar>(
            20 + 160 * light(bench.column_at(x), bench.row_at(y)) + noise * scatter(bench.rng));
    }
    files_.push_back(folder_ / image_name(static_cast<int>(files_.size())));
    EXPECT_TRUE(write_png(files_.back(), photo).ok());
  }

  std::vector<fs::path> files_;
  fs::path folder_;
};

// Decodes the imported captures of a bench and returns the coordinates' root mean square error.
double imported_error(WaveBench* waves, const fs::path& folder) {
  waves->photograph(folder / "pose0");
  ForeignPhaseCaptures foreign{folder, WaveBench::k_width, WaveBench::k_height,
                               Board::parse("chessboard:9x7:75mm").value()};
  foreign.series = waves->series;
  if (foreign.series.white == WhitePlace::absent) foreign.series.white = WhitePlace::white_black_last;
  const auto captures = import_phase(foreign);
  EXPECT_TRUE(captures.ok()) << captures.message();
  if (!captures) return 1e9;
  const auto decoded =
      decode(captures->patterns[0], captures->poses[0].images[0][0], waves->bench.width, waves->bench.height);
  EXPECT_TRUE(decoded.ok()) << decoded.message();
  double squared = 0;
  int count = 0, all = 0;
  for (int y = 8; y < waves->bench.height - 8; ++y) {
    for (int x = 8; x < waves->bench.width - 8; ++x) {
      const double row = waves->bench.row_at(y);
      if (row > WaveBench::k_height - 2) continue;
      ++all;
      const auto& px = decoded->px_projector.at<cv::Vec2f>(y, x);
      if (std::isnan(px[0])) continue;
      squared += std::pow(px[0] - waves->bench.column_at(x), 2) + std::pow(px[1] - row, 2);
      ++count;
    }
  }
  EXPECT_GT(count, 0.97 * all);
  return std::sqrt(squared / count);
}

TEST(PhaseImport, SeveralPeriodsGiveCoordinates) {
  WaveBench waves;
  waves.series.column_periods = {64, 16, 5.5};
  waves.noise = 1.5;
  EXPECT_LT(imported_error(&waves, test::test_folder()), 0.06);
}

TEST(PhaseImport, ACueNumbersTheWaves) {
  for (const InversePlace inverses : {InversePlace::none, InversePlace::second}) {
    WaveBench waves;
    waves.series.column_periods = {10};
    waves.series.row_periods = {12, 6};
    waves.series.steps = 5;
    waves.series.is_cued = true;
    waves.series.cue_inverses = inverses;
    waves.series.axes = AxisOrder::rows_columns;
    waves.series.white = WhitePlace::white_black_first;
    waves.noise = 1;
    EXPECT_LT(imported_error(&waves, test::test_folder() / std::to_string(static_cast<int>(inverses))), 0.06);
  }
}

TEST(PhaseImport, EveryFormOfTheWaveIsRead) {
  for (const bool is_backward : {false, true}) {
    for (const WaveForm form :
         {WaveForm::cosine, WaveForm::sine, WaveForm::minus_cosine, WaveForm::minus_sine}) {
      WaveBench waves;
      waves.series.column_periods = {80, 16};
      waves.series.wave = form;
      waves.series.is_backward = is_backward;
      waves.series.white = WhitePlace::white_black_last;
      EXPECT_LT(
          imported_error(&waves, test::test_folder() / (k_wave_forms.text(form) + (is_backward ? "b" : "f"))),
          0.06)
          << k_wave_forms.text(form) << is_backward;
    }
  }
}

TEST(PhaseImport, AWrongFormIsNamedWithTheRightOne) {
  WaveBench waves;
  waves.series.column_periods = {96, 16};
  waves.series.wave = WaveForm::sine;
  const fs::path folder = test::test_folder();
  const auto files = waves.photograph(folder / "photos");
  PhaseSeries wrong = waves.series;
  wrong.wave = WaveForm::cosine;
  const auto read = recoded(wrong, files, WaveBench::k_width, WaveBench::k_height, folder / "made");
  ASSERT_FALSE(read.ok());
  EXPECT_NE(read.message().find("--wave=sin"), std::string::npos) << read.message();
}

TEST(PhaseImport, DescriptionsThatCannotBeAreRefused) {
  PhaseSeries series;
  series.column_periods = {32, 16};
  EXPECT_NE(check(series, 64, 48).message().find("does not cover"), std::string::npos);
  series.is_cued = true;
  EXPECT_TRUE(check(series, 64, 48).ok());
  series.steps = 2;
  EXPECT_NE(check(series, 64, 48).message().find("--steps"), std::string::npos);
  series.steps = 4;
  series.column_periods = {16, 32};
  EXPECT_NE(check(series, 64, 48).message().find("shorter"), std::string::npos);
}

}  // namespace
}  // namespace limn::calib
