#include "calib/code/phase_import.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/file.h"
#include "core/image_io.h"
#include "core/median.h"
#include "core/names.h"

namespace limn::calib {
namespace {

namespace fs = std::filesystem;

constexpr float k_unknown = std::numeric_limits<float>::quiet_NaN();
constexpr double k_full_turn = 2 * std::numbers::pi;
constexpr int k_own_period_px = 32, k_own_steps = 6;  // the images that are written
constexpr float k_least_amplitude = 4;                // levels; below, noise turns the phase by a quarter
constexpr float k_of_brightest = 0.06F;  // share of the brightest amplitudes: light of the projector
constexpr double k_most_off =
    0.15;  // median distance of a wave from what the coarser one says, share of a wave

// One axis of a series: the indices of its images, and its periods.
struct PhaseAxis {
  int size = 0;
  std::vector<int> cue, cue_inverses;
  std::vector<double> periods;
  std::vector<std::vector<int>> steps;  // for each period
};

const std::vector<double>& row_periods_of(const PhaseSeries& series) {
  return series.row_periods.empty() ? series.column_periods : series.row_periods;
}

int cue_bits(const PhaseSeries& series, int size, const std::vector<double>& periods) {
  return series.is_cued ? bits_for(std::max(2, static_cast<int>(std::ceil(size / periods[0])))) : 0;
}

PhaseAxis axis_of(const PhaseSeries& series, int size, const std::vector<double>& periods, int* next) {
  PhaseAxis axis{size, {}, {}, periods, {}};
  for (int bit = cue_bits(series, size, periods); bit > 0; --bit) {
    if (series.cue_inverses == InversePlace::first) axis.cue_inverses.push_back((*next)++);
    axis.cue.push_back((*next)++);
    if (series.cue_inverses == InversePlace::second) axis.cue_inverses.push_back((*next)++);
  }
  for (size_t i = 0; i < periods.size(); ++i) {
    axis.steps.emplace_back();
    for (int k = 0; k < series.steps; ++k) axis.steps.back().push_back((*next)++);
  }
  return axis;
}

bool is_white_first(WhitePlace place) {
  return place == WhitePlace::white_black_first || place == WhitePlace::black_white_first;
}

struct PhaseAxes {
  PhaseAxis columns, rows;
  int count = 0;
};

PhaseAxes axes_of(const PhaseSeries& series, int width, int height) {
  PhaseAxes axes;
  int next = is_white_first(series.white) ? 2 : 0;
  const bool rows_first = series.axes == AxisOrder::rows_columns;
  if (rows_first) axes.rows = axis_of(series, height, row_periods_of(series), &next);
  axes.columns = axis_of(series, width, series.column_periods, &next);
  if (!rows_first) axes.rows = axis_of(series, height, row_periods_of(series), &next);
  axes.count = next + (series.white != WhitePlace::absent && !is_white_first(series.white) ? 2 : 0);
  return axes;
}

// A wave's phase, as a share of a turn (0 to 1), its amplitude and its mean light; CV_32F.
struct Wave {
  cv::Mat turns, amplitude, mean;
};

Wave wave_of(const std::vector<cv::Mat>& images, const std::vector<int>& steps) {
  const cv::Size size = images[0].size();
  Wave wave{cv::Mat(size, CV_32F), cv::Mat(size, CV_32F), cv::Mat(size, CV_32F)};
  const auto n = static_cast<double>(steps.size());
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      double cosine = 0, sine = 0, sum = 0;
      for (size_t k = 0; k < steps.size(); ++k) {
        const double angle = k_full_turn * static_cast<double>(k) / n;
        const double light = images[static_cast<size_t>(steps[k])].at<uchar>(y, x);
        cosine += std::cos(angle) * light;
        sine += std::sin(angle) * light;
        sum += light;
      }
      wave.turns.at<float>(y, x) = static_cast<float>(std::atan2(sine, cosine) / k_full_turn);
      wave.amplitude.at<float>(y, x) = static_cast<float>(2 / n * std::hypot(cosine, sine));
      wave.mean.at<float>(y, x) = static_cast<float>(sum / n);
    }
  }
  return wave;
}

// The share of a wave at which a pixel lies, from 0 to 1, by the wave's form.
float share_of(float turns, WaveForm form, bool is_backward) {
  // sin(a) = cos(a - 1/4 turn), -cos(a) = cos(a - 1/2), -sin(a) = cos(a - 3/4).
  const float later = 0.25F * static_cast<float>(form);
  // The phase found is that of cos(a - step). Backward it is of cos(a + step): the opposite.
  const float share = (is_backward ? -turns : turns) + later;
  return share - std::floor(share);
}

// The number of a pixel's wave by the cue.
int cued_wave(const std::vector<cv::Mat>& images, const PhaseAxis& axis, float mean, int y, int x) {
  unsigned gray = 0;
  for (size_t i = 0; i < axis.cue.size(); ++i) {
    const float light = images[static_cast<size_t>(axis.cue[i])].at<uchar>(y, x);
    const float against =
        axis.cue_inverses.empty() ? mean : images[static_cast<size_t>(axis.cue_inverses[i])].at<uchar>(y, x);
    gray = gray << 1 | (light > against ? 1U : 0U);
  }
  for (unsigned shift = 1; shift < 16; shift *= 2) gray ^= gray >> shift;
  return static_cast<int>(gray);
}

// Waves whose number differs by one from their neighbours': the cue and the wave do not end at the same
// pixel.
void mend_waves(double period, cv::Mat* px) {
  const cv::Mat before = px->clone();
  std::vector<float> near;
  for (int y = 0; y < before.rows; ++y) {
    for (int x = 0; x < before.cols; ++x) {
      float& own = px->at<float>(y, x);
      if (std::isnan(own)) continue;
      near.clear();
      for (int v = std::max(0, y - 2); v <= std::min(before.rows - 1, y + 2); ++v) {
        for (int u = std::max(0, x - 2); u <= std::min(before.cols - 1, x + 2); ++u)
          if (!std::isnan(before.at<float>(v, u))) near.push_back(before.at<float>(v, u));
      }
      const auto waves =
          std::round((value_of_rank(&near, near.size() / 2) - own) / static_cast<float>(period));
      if (std::abs(waves) == 1) own += waves * static_cast<float>(period);
    }
  }
}

// Coordinates of an axis, projector pixels; NaN where there is no wave. `off`: median distance of a finer
// wave from what the coarser one says, as a share of a wave: 0 to 0.5; the worst of all periods.
struct Coordinates {
  cv::Mat px, amplitude, mean;
  double off = 0;
};

Coordinates coordinates_of(const std::vector<cv::Mat>& images,
                           const PhaseAxis& axis,
                           const std::vector<Wave>& waves,
                           WaveForm form,
                           bool is_backward) {
  const cv::Size size = images[0].size();
  Coordinates found{cv::Mat(size, CV_32F, cv::Scalar(k_unknown)), waves.back().amplitude, waves.back().mean};
  std::vector<float> amplitudes(found.amplitude.begin<float>(), found.amplitude.end<float>());
  const float least = std::max(k_least_amplitude, k_of_brightest * quantile(std::move(amplitudes), 0.95));
  for (size_t i = 0; i < axis.periods.size(); ++i) {
    const auto period = static_cast<float>(axis.periods[i]);
    std::vector<float> off;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        float& px = found.px.at<float>(y, x);
        if (found.amplitude.at<float>(y, x) < least) continue;
        const float within = period * share_of(waves[i].turns.at<float>(y, x), form, is_backward);
        if (i > 0) {
          if (std::isnan(px)) continue;
          const float wave = std::round((px - within) / period), at = wave * period + within;
          off.push_back(std::abs(at - px) / period);
          px = at;
        } else if (axis.cue.empty()) {
          px = within;
        } else {
          px = within +
               period * static_cast<float>(cued_wave(images, axis, waves[0].mean.at<float>(y, x), y, x));
        }
      }
    }
    if (i == 0 && !axis.cue.empty()) {
      const cv::Mat cued = found.px.clone();
      mend_waves(period, &found.px);
      // Where cue and wave do not begin together, the pixels between need mending.
      const cv::Mat mended = cv::abs(cued - found.px) > period / 2;
      const auto known = static_cast<double>(cv::countNonZero(found.px == found.px));
      found.off = std::max(found.off, known > 0 ? cv::countNonZero(mended) / known : 0.5);
    }
    if (!off.empty()) found.off = std::max<double>(found.off, median(std::move(off)));
  }
  return found;
}

std::vector<Wave> waves_of(const std::vector<cv::Mat>& images, const PhaseAxis& axis) {
  std::vector<Wave> waves;
  for (const std::vector<int>& steps : axis.steps) waves.push_back(wave_of(images, steps));
  return waves;
}

// The forms of wave that fit, in words.
std::string forms_that_fit(const std::vector<cv::Mat>& images,
                           const PhaseAxis& axis,
                           const std::vector<Wave>& waves) {
  std::vector<std::string> fitting;
  for (const bool is_backward : {false, true}) {
    for (const WaveForm form :
         {WaveForm::cosine, WaveForm::sine, WaveForm::minus_cosine, WaveForm::minus_sine}) {
      if (coordinates_of(images, axis, waves, form, is_backward).off < k_most_off)
        fitting.push_back(
            fmt::format("--wave={}{}", k_wave_forms.text(form), is_backward ? " --backward" : ""));
    }
  }
  return joined_names(fitting, "none: check --periods, --steps and --order");
}

Result<Coordinates> checked(const std::vector<cv::Mat>& images,
                            const PhaseAxis& axis,
                            const PhaseSeries& series,
                            const std::string& where,
                            const char* name) {
  const std::vector<Wave> waves = waves_of(images, axis);
  Coordinates found = coordinates_of(images, axis, waves, series.wave, series.is_backward);
  if (found.off < k_most_off) return found;
  return error(
      "{}: the waves do not fit their description: those of the {} are off by {:.2f} of a wave from what the "
      "coarser "
      "waves or the cue say (median). Forms that fit: {}.",
      where, name, found.off, forms_that_fit(images, axis, waves));
}

// What a camera pixel at this coordinate sees of a pattern's stripes or wave, 0 to 1.
double light_at(const Patterns& patterns, int index, double column, double row) {
  const int block = patterns.block_px();
  if (index >= patterns.first_step()) {
    const int step = index - patterns.first_step();
    const double px = step < patterns.steps() ? column : row;
    const double turns =
        px / patterns.options.period_px - static_cast<double>(step % patterns.steps()) / patterns.steps();
    return 0.5 + 0.5 * std::cos(k_full_turn * turns);
  }
  const bool is_column = index < patterns.first_row_bit();
  const int bits = is_column ? patterns.column_bits() : patterns.row_bits();
  const int from_widest = (is_column ? index : index - patterns.first_row_bit()) / 2;
  const int label = static_cast<int>(std::lround(is_column ? column : row)) / block;
  const bool lit = ((label ^ (label >> 1)) >> (bits - 1 - from_widest) & 1) != 0;
  return lit != (index % 2 == 1) ? 1 : 0;
}

Result<std::vector<fs::path>> write_recoded(const Coordinates& columns,
                                            const Coordinates& rows,
                                            const Patterns& patterns,
                                            const fs::path& folder) {
  LIMN_TRY_STATUS(make_folder(folder));
  const cv::Size size = columns.px.size();
  std::vector<fs::path> files;
  for (int i = 0; i < patterns.count(); ++i) {
    cv::Mat image(size, CV_8U);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const double mean = (columns.mean.at<float>(y, x) + rows.mean.at<float>(y, x)) / 2;
        const double column = columns.px.at<float>(y, x), row = rows.px.at<float>(y, x);
        const bool inside = column >= -0.5 && row >= -0.5 && column < patterns.width - 0.5 &&
                            row < patterns.height - 0.5;  // false for NaN
        const double amplitude =
            inside ? (columns.amplitude.at<float>(y, x) + rows.amplitude.at<float>(y, x)) / 2 : 0;
        const double share = i == patterns.white()   ? 1
                             : i == patterns.black() ? 0
                             : inside                ? light_at(patterns, i, column, row)
                                                     : 0.5;
        image.at<uchar>(y, x) = cv::saturate_cast<uchar>(mean + amplitude * (2 * share - 1));
      }
    }
    files.push_back(folder / image_name(i));
    LIMN_TRY_STATUS(write_png(files.back(), image, {.compression = 1}));
  }
  return files;
}

}  // namespace

int PhaseSeries::count(int projector_width, int projector_height) const {
  return axes_of(*this, projector_width, projector_height).count;
}

Status check(const PhaseSeries& series, int projector_width, int projector_height) {
  if (series.steps < 3 || series.steps > 32)
    return error("--steps: expected 3 to 32 images of a wave, found {}.", series.steps);
  for (const auto& [periods, size] : {std::pair{series.column_periods, projector_width},
                                      std::pair{row_periods_of(series), projector_height}}) {
    if (periods.empty())
      return error("--periods: expected lengths of waves in projector pixels, found none.");
    if (!series.is_cued && periods[0] < size)
      return error(
          "--periods: the first, {} px, does not cover the projector's {} px: expected a period of {} or "
          "more "
          "first, or --cue.",
          periods[0], size, size);
    for (size_t i = 0; i < periods.size(); ++i) {
      if (!(periods[i] >= 2)) return error("--periods: expected 2 px or more, found {}.", periods[i]);
      if (i > 0 && !(periods[i] < periods[i - 1] && periods[i - 1] <= 40 * periods[i]))
        return error(
            "--periods: expected each shorter than the one before, by a factor of at most 40, found {} after "
            "{}.",
            periods[i], periods[i - 1]);
    }
  }
  return {};
}

Patterns recoded_patterns(int projector_width, int projector_height) {
  return Patterns::create(PatternCode::phase, projector_width, projector_height,
                          {.period_px = k_own_period_px, .steps = k_own_steps, .gamma = 1})
      .value();
}

Result<std::vector<fs::path>> recoded(const PhaseSeries& series,
                                      const std::vector<fs::path>& images,
                                      int projector_width,
                                      int projector_height,
                                      const fs::path& folder) {
  std::vector<cv::Mat> read;
  for (const fs::path& path : images) {
    LIMN_TRY(cv::Mat image, read_grey_image(path));
    if (!read.empty() && image.size() != read[0].size())
      return error("{}: expected an image of {}x{} pixels, as the others of its series, found {}x{}.",
                   path.string(), read[0].cols, read[0].rows, image.cols, image.rows);
    read.push_back(std::move(image));
  }
  const PhaseAxes axes = axes_of(series, projector_width, projector_height);
  const std::string where = images[0].parent_path().string();
  LIMN_TRY(const Coordinates columns, checked(read, axes.columns, series, where, "columns"));
  LIMN_TRY(const Coordinates rows, checked(read, axes.rows, series, where, "rows"));
  return write_recoded(columns, rows, recoded_patterns(projector_width, projector_height), folder);
}

}  // namespace limn::calib
