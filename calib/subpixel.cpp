#include "calib/subpixel.h"

#include <bit>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

namespace limn::calib {
namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();
constexpr int k_longest = 64;  // camera pixels between two edges: a line is no longer the surface beyond

// A place on a line of camera pixels where the light of a label's edge falls.
struct Crossing {
  int edge = -1;       // between labels edge - 1 and edge; -1: none
  float at = 0;        // camera pixels along the line
  float variance = 0;  // of it, camera pixels^2
};

// The edge between two neighbouring pixels' labels; -1 when they are the same or do not touch.
int edge_between(int low_a, int end_a, int low_b, int end_b) {
  if (low_a == end_a || low_b == end_b || low_a == low_b) return -1;
  if (end_a == low_b) return low_b;
  if (end_b == low_a) return low_a;
  return -1;
}

bool nested(int low_a, int end_a, int low_b, int end_b) {
  if (low_a == end_a || low_b == end_b) return false;
  return (low_a <= low_b && end_b <= end_a) || (low_b <= low_a && end_a <= end_b);
}

// Estimates on one axis, so far: weighted sum and weight of each pixel.
struct Sums {
  cv::Mat value, weight;
};

// Fills the pixels behind `first` up to `second` of a line; `step`: elements from one pixel to the next.
void fill_between(
    const Crossing& first, const Crossing& second, float floor, float* value, float* weight, size_t step) {
  const int from = static_cast<int>(std::floor(first.at)) + 1, to = static_cast<int>(std::floor(second.at));
  const float length = second.at - first.at;
  const auto rise = static_cast<float>(second.edge - first.edge);
  const float scale = (rise / length) * (rise / length);
  for (int i = from; i <= to; ++i) {
    const float share = (static_cast<float>(i) - first.at) / length;
    const float u = static_cast<float>(first.edge) - 0.5F + share * rise;
    const float variance =
        scale * ((1 - share) * (1 - share) * first.variance + share * share * second.variance) + floor;
    value[static_cast<size_t>(i) * step] += u / variance;
    weight[static_cast<size_t>(i) * step] += 1 / variance;
  }
}

// One line's walk, whose pixels come one by one.
class Walk {
 public:
  void pass(const AxisReading& reading,
            const AxisLabels& labels,
            cv::Point a,
            cv::Point b,
            int at,
            double noise,
            float floor,
            float* value,
            float* weight,
            size_t step) {
    const int low_a = labels.low.at<int>(a), end_a = labels.end.at<int>(a);
    const int low_b = labels.low.at<int>(b), end_b = labels.end.at<int>(b);
    if (nested(low_a, end_a, low_b, end_b)) return;  // the same label goes on, perhaps a coarser one
    const Crossing next = crossing(reading, edge_between(low_a, end_a, low_b, end_b), a, b, at, noise);
    if (last_.edge >= 0 && next.edge >= 0 && next.edge != last_.edge && next.at - last_.at < k_longest)
      fill_between(last_, next, floor, value, weight, step);
    last_ = next;
  }

 private:
  static Crossing crossing(
      const AxisReading& reading, int edge, cv::Point a, cv::Point b, int at, double noise) {
    if (edge <= 0) return {};
    const cv::Mat& difference = reading.at_edge(edge);
    const float first = difference.at<short>(a), second = difference.at<short>(b);
    if ((first > 0) == (second > 0)) return {};
    const float step = first - second, share = first / step;
    // Each difference holds the noise of two intensities.
    const auto variance =
        static_cast<float>(2 * noise * noise) * ((1 - share) * (1 - share) + share * share) / (step * step);
    return {edge, static_cast<float>(at) + share, variance};
  }

  Crossing last_;
};

void along_rows(const AxisReading& reading, const AxisLabels& labels, double noise, float floor, Sums* sums) {
  for (int y = 0; y < labels.low.rows; ++y) {
    Walk walk;
    for (int x = 0; x + 1 < labels.low.cols; ++x)
      walk.pass(reading, labels, {x, y}, {x + 1, y}, x, noise, floor, sums->value.ptr<float>(y),
                sums->weight.ptr<float>(y), 1);
  }
}

void along_columns(
    const AxisReading& reading, const AxisLabels& labels, double noise, float floor, Sums* sums) {
  std::vector<Walk> walks(static_cast<size_t>(labels.low.cols));
  for (int y = 0; y + 1 < labels.low.rows; ++y) {
    for (int x = 0; x < labels.low.cols; ++x)
      walks[static_cast<size_t>(x)].pass(reading, labels, {x, y}, {x, y + 1}, y, noise, floor,
                                         sums->value.ptr<float>() + x, sums->weight.ptr<float>() + x,
                                         static_cast<size_t>(labels.low.cols));
  }
}

}  // namespace

const cv::Mat& AxisReading::at_edge(int edge) const {
  const int bit = std::countr_zero(static_cast<unsigned>(edge));  // the one that Gray code changes there
  return differences[static_cast<size_t>(bits() - 1 - bit)];
}

AxisLabels::AxisLabels(int rows, int cols)
    : low(rows, cols, CV_32S, cv::Scalar(0)),
      end(rows, cols, CV_32S, cv::Scalar(0)),
      px(rows, cols, CV_32F, cv::Scalar(k_nan)),
      variance(rows, cols, CV_32F, cv::Scalar(k_nan)) {}

void refine_between_edges(const AxisReading& reading, double noise, double floor_px, AxisLabels* labels) {
  const auto floor = static_cast<float>(floor_px * floor_px);
  Sums sums{cv::Mat(labels->low.size(), CV_32F, cv::Scalar(0)),
            cv::Mat(labels->low.size(), CV_32F, cv::Scalar(0))};
  along_rows(reading, *labels, noise, floor, &sums);
  along_columns(reading, *labels, noise, floor, &sums);
  for (int y = 0; y < sums.value.rows; ++y) {
    const float *value = sums.value.ptr<float>(y), *weight = sums.weight.ptr<float>(y);
    float *px = labels->px.ptr<float>(y), *variance = labels->variance.ptr<float>(y);
    for (int x = 0; x < sums.value.cols; ++x) {
      // The two directions share their noise and their floor: the better of them at best, for the variance.
      if (weight[x] * variance[x] <= 1 || std::isnan(px[x])) continue;
      px[x] = value[x] / weight[x];
      variance[x] = std::max(1 / weight[x], floor);
    }
  }
}

}  // namespace limn::calib
