#include "calib/code/subpixel.h"

#include <bit>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

namespace limn::calib {
namespace {

constexpr float k_no_label = std::numeric_limits<float>::quiet_NaN();
// Camera pixels between two edges; over more, a line does not describe the surface.
constexpr int k_longest = 64;

// A position on a line of camera pixels where a label's edge appears.
struct Crossing {
  int edge = -1;       // between labels edge - 1 and edge; -1: none
  float at = 0;        // camera pixels along the line
  float variance = 0;  // variance of `at`, camera pixels^2
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

// Estimates on one axis so far: weighted sum and weight of each pixel.
struct Sums {
  cv::Mat value, weight;
};

// Interpolates the pixels after `first` up to `second` of a line; `step`: elements from one pixel to the
// next.
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

// The labels of neighbouring lines or pixels, and the sums that interpolated values are added to.
struct Place {
  const short *low_a, *end_a, *low_b, *end_b;
};

// Finds where the difference of the bit that changes at `edge` crosses zero between pixels a and b; `at` is
// the position along the line.
Crossing crossing(const AxisReading& reading, int edge, cv::Point a, cv::Point b, int at, float variance) {
  const cv::Mat& difference = reading.at_edge(edge);
  const float first = difference.ptr<short>(a.y)[a.x], second = difference.ptr<short>(b.y)[b.x];
  if ((first > 0) == (second > 0)) return {};
  const float step = first - second, share = first / step;
  return {edge, static_cast<float>(at) + share,
          variance * ((1 - share) * (1 - share) + share * share) / (step * step)};
}

// Moves from pixel a to pixel b of a line; `last` is the previous edge.
void pass(const AxisReading& reading,
          const DifferenceNoise& noise,
          const Place& labels,
          cv::Point a,
          cv::Point b,
          int at,
          float floor,
          Crossing* last,
          float* value,
          float* weight,
          size_t step) {
  const int low_a = labels.low_a[a.x], end_a = labels.end_a[a.x];
  const int low_b = labels.low_b[b.x], end_b = labels.end_b[b.x];
  if (low_a == low_b && end_a == end_b && low_a != end_a) return;
  if (nested(low_a, end_a, low_b, end_b)) return;  // the same label, perhaps a coarser one
  const int edge = edge_between(low_a, end_a, low_b, end_b);
  const Crossing next = edge > 0 ? crossing(reading, edge, a, b, at, noise.at(a.x, a.y)) : Crossing{};
  if (last->edge >= 0 && next.edge >= 0 && next.edge != last->edge && next.at - last->at < k_longest)
    fill_between(*last, next, floor, value, weight, step);
  *last = next;
}

void along_rows(const AxisReading& reading,
                const DifferenceNoise& noise,
                const AxisLabels& labels,
                float floor,
                Sums* sums) {
  for (int y = 0; y < labels.low.rows; ++y) {
    const short *low = labels.low.ptr<short>(y), *end = labels.end.ptr<short>(y);
    float *value = sums->value.ptr<float>(y), *weight = sums->weight.ptr<float>(y);
    Crossing last;
    for (int x = 0; x + 1 < labels.low.cols; ++x)
      pass(reading, noise, {low, end, low, end}, {x, y}, {x + 1, y}, x, floor, &last, value, weight, 1);
  }
}

void along_columns(const AxisReading& reading,
                   const DifferenceNoise& noise,
                   const AxisLabels& labels,
                   float floor,
                   Sums* sums) {
  const auto columns = static_cast<size_t>(labels.low.cols);
  std::vector<Crossing> last(columns);
  float *value = sums->value.ptr<float>(), *weight = sums->weight.ptr<float>();
  for (int y = 0; y + 1 < labels.low.rows; ++y) {
    const Place place = {labels.low.ptr<short>(y), labels.end.ptr<short>(y), labels.low.ptr<short>(y + 1),
                         labels.end.ptr<short>(y + 1)};
    for (int x = 0; x < labels.low.cols; ++x)
      pass(reading, noise, place, {x, y}, {x, y + 1}, y, floor, &last[static_cast<size_t>(x)], value + x,
           weight + x, columns);
  }
}

}  // namespace

const cv::Mat& AxisReading::at_edge(int edge) const {
  const int bit = std::countr_zero(static_cast<unsigned>(edge));  // the bit that Gray code changes there
  return differences[static_cast<size_t>(bits() - 1 - bit)];
}

AxisLabels::AxisLabels(int rows, int cols)
    : low(rows, cols, CV_16S, cv::Scalar(0)),
      end(rows, cols, CV_16S, cv::Scalar(0)),
      px(rows, cols, CV_32F, cv::Scalar(k_no_label)),
      variance(rows, cols, CV_32F, cv::Scalar(k_no_label)) {}

void refine_between_edges(const AxisReading& reading,
                          const DifferenceNoise& noise,
                          double floor_px,
                          AxisLabels* labels) {
  const auto floor = static_cast<float>(floor_px * floor_px);
  Sums sums{cv::Mat(labels->low.size(), CV_32F, cv::Scalar(0)),
            cv::Mat(labels->low.size(), CV_32F, cv::Scalar(0))};
  along_rows(reading, noise, *labels, floor, &sums);
  along_columns(reading, noise, *labels, floor, &sums);
  for (int y = 0; y < sums.value.rows; ++y) {
    const float *value = sums.value.ptr<float>(y), *weight = sums.weight.ptr<float>(y);
    float *px = labels->px.ptr<float>(y), *variance = labels->variance.ptr<float>(y);
    for (int x = 0; x < sums.value.cols; ++x) {
      // The two directions share noise and floor, so the variance is that of the better one.
      if (weight[x] * variance[x] <= 1 || std::isnan(px[x])) continue;
      px[x] = value[x] / weight[x];
      variance[x] = std::max(1 / weight[x], floor);
    }
  }
}

}  // namespace limn::calib
