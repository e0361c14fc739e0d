#include "calib/code/phase.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

namespace limn::calib {
namespace {

constexpr float k_max_turn = 0.1F;   // share of a wave: maximum noise of a phase that is used
constexpr float k_max_apart = 0.4F;  // share of a wave between label and phase; the next wave begins at half

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
                     AxisLabels* labels) {
  const auto period = static_cast<float>(reading.period_px());
  const float px_by_radian = period / (2 * std::numbers::pi_v<float>);
  const auto floor = static_cast<float>(floor_px * floor_px);
  for (int y = 0; y < labels->px.rows; ++y) {
    const float *c = reading.cosines().ptr<float>(y), *s = reading.sines().ptr<float>(y);
    float *px = labels->px.ptr<float>(y), *variance = labels->variance.ptr<float>(y);
    for (int x = 0; x < labels->px.cols; ++x) {
      if (std::isnan(px[x])) continue;
      // Amplitude = 2 / N |(c, s)|; a difference of two intensities has twice the variance of one.
      const float squared = c[x] * c[x] + s[x] * s[x];
      const float radians2 =
          noise.at(x, y) * static_cast<float>(reading.steps()) / std::max(4 * squared, 1e-6F);
      if (radians2 * px_by_radian * px_by_radian > k_max_turn * k_max_turn * period * period) continue;
      const float within = std::atan2(s[x], c[x]) * px_by_radian;
      const float wave = std::round((px[x] - within) / period);
      const float found = within + wave * period;
      if (std::abs(found - px[x]) > k_max_apart * period) continue;
      px[x] = found;
      variance[x] = radians2 * px_by_radian * px_by_radian + floor;
    }
  }
}

}  // namespace limn::calib
