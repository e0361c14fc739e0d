#include "calib/code/phase.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

namespace limn::calib {
namespace {

constexpr float k_max_turn = 0.1F;   // share of a wave: maximum noise of a phase that is used
constexpr float k_max_apart = 0.4F;  // share of a wave between label and phase; the next wave begins at half

// A step's angle and what its pair's light and displacement do.
struct PairTerm {
  float angle, cosine, sine;
  float gain_difference, shift_x, shift_y;
};

std::vector<PairTerm> terms_of(const std::vector<PairShake>& shake, int steps) {
  std::vector<PairTerm> terms;
  for (const PairShake& pair : shake) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(terms.size()) / steps;
    terms.push_back({static_cast<float>(angle), static_cast<float>(std::cos(angle)),
                     static_cast<float>(std::sin(angle)), static_cast<float>(pair.gain_difference),
                     static_cast<float>(pair.shift_px.x()), static_cast<float>(pair.shift_px.y())});
  }
  return terms;
}

// The label of an image that is displaced by m is that of a place m away: less by slope . m. A step counts
// with the squared sine of its angle to the phase, because that is where its light changes.
float moved_by(const std::vector<PairTerm>& terms, int steps, float phase, const cv::Vec2f& slope) {
  float sum = 0;
  for (const PairTerm& term : terms) {
    const float sine = std::sin(phase - term.angle);
    sum += sine * sine * (slope[0] * term.shift_x + slope[1] * term.shift_y);
  }
  return std::isnan(sum) ? 0 : 4 * sum / static_cast<float>(steps);
}

// Takes the displacements of the steps out of the labels.
void settle_steps(const PhaseReading& reading, const std::vector<PairTerm>& terms, AxisLabels* labels) {
  const LabelSlopes slopes(labels->px);
  for (int y = 0; y < labels->px.rows; ++y) {
    const float *c = reading.cosines().ptr<float>(y), *s = reading.sines().ptr<float>(y);
    float* px = labels->px.ptr<float>(y);
    for (int x = 0; x < labels->px.cols; ++x) {
      if (!std::isnan(px[x]))
        px[x] += moved_by(terms, reading.steps(), std::atan2(s[x], c[x]), slopes.at(x, y));
    }
  }
}

}  // namespace

PhaseReading::PhaseReading(int rows, int cols, int period_px, int steps)
    : period_px_(period_px),
      steps_(steps),
      cosines_(rows, cols, CV_32F, cv::Scalar(0)),
      sines_(rows, cols, CV_32F, cv::Scalar(0)) {}

void PhaseReading::add_step(int step, const cv::Mat& image) {
  const double angle = 2 * std::numbers::pi * step / steps_;
  const auto cosine = static_cast<float>(std::cos(angle)), sine = static_cast<float>(std::sin(angle));
  for (int y = 0; y < image.rows; ++y) {
    const uchar* light = image.ptr<uchar>(y);
    float *c = cosines_.ptr<float>(y), *s = sines_.ptr<float>(y);
    for (int x = 0; x < image.cols; ++x) {
      c[x] += cosine * light[x];
      s[x] += sine * light[x];
    }
  }
}

void refine_by_phase(const PhaseReading& reading,
                     const DifferenceNoise& noise,
                     double floor_px,
                     const std::vector<PairShake>& shake,
                     AxisLabels* labels) {
  const std::vector<PairTerm> terms = terms_of(shake, reading.steps());
  const auto period = static_cast<float>(reading.period_px());
  const float px_by_radian = period / (2 * std::numbers::pi_v<float>);
  const auto floor = static_cast<float>(floor_px * floor_px);
  for (int y = 0; y < labels->px.rows; ++y) {
    const float *c = reading.cosines().ptr<float>(y), *s = reading.sines().ptr<float>(y);
    float *px = labels->px.ptr<float>(y), *variance = labels->variance.ptr<float>(y);
    for (int x = 0; x < labels->px.cols; ++x) {
      if (std::isnan(px[x])) continue;
      // Amplitude = 2 / N |(c, s)|; a difference of two intensities has twice the variance of one.
      float cosine = c[x], sine = s[x];
      for (const PairTerm& term : terms) {  // white plus black is twice the wave's mean light
        const float more = term.gain_difference * static_cast<float>(noise.sum.ptr<ushort>(y)[x]) / 2;
        cosine -= term.cosine * more;
        sine -= term.sine * more;
      }
      const float squared = cosine * cosine + sine * sine;
      const float radians2 =
          noise.at(x, y) * static_cast<float>(reading.steps()) / std::max(4 * squared, 1e-6F);
      if (radians2 * px_by_radian * px_by_radian > k_max_turn * k_max_turn * period * period) continue;
      const float phase = std::atan2(sine, cosine);
      const float within = phase * px_by_radian;
      const float wave = std::round((px[x] - within) / period);
      const float found = within + wave * period;
      if (std::abs(found - px[x]) > k_max_apart * period) continue;
      px[x] = found;
      variance[x] = radians2 * px_by_radian * px_by_radian + floor;
    }
  }
  if (!terms.empty()) settle_steps(reading, terms, labels);
}

}  // namespace limn::calib
