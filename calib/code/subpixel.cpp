#include "calib/code/subpixel.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>

namespace limn::calib {
namespace {

constexpr float k_no_label = std::numeric_limits<float>::quiet_NaN();
// Camera pixels between two edges; over more, a line does not describe the surface.
constexpr int k_longest = 64;
// Camera pixels between two edges below which labels are straight: noise would be taken for curvature.
constexpr float k_straight = 4;
// Standard deviation of the labels' curvature where it is not known, labels per camera pixel^2: over 10
// pixels a line is then wrong by 0.01 pixels, as the floor is.
constexpr float k_any_curvature = 1e-3F;
constexpr int k_field = 16;           // side of a field that a plane is fitted to, camera pixels
constexpr double k_one_surface = 1;   // labels, root mean square beside the plane
constexpr size_t k_least_edges = 12;  // in a field

// A position on a line of camera pixels where a label's edge appears.
struct Crossing {
  int edge = -1;       // between labels edge - 1 and edge; -1: none
  float at = 0;        // camera pixels along the line
  float label = 0;     // the coordinate there, labels
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

// The second derivative of the labels along a line at the middle one of three crossings, labels per camera
// pixel^2.
struct Curvature {
  float value = 0, variance = 0;
};
Curvature curvature_at(const Crossing& before, const Crossing& middle, const Crossing& after, float floor) {
  const float length_a = middle.at - before.at, length_b = after.at - middle.at, span = length_a + length_b;
  const float slope_a = (middle.label - before.label) / length_a,
              slope_b = (after.label - middle.label) / length_b;
  const auto of_slope = [&](float slope, float length, const Crossing& a, const Crossing& b) {
    return (slope * slope * (a.variance + b.variance) + 2 * floor) / (length * length);
  };
  return {2 * (slope_b - slope_a) / span,
          4 / (span * span) *
              (of_slope(slope_a, length_a, before, middle) + of_slope(slope_b, length_b, middle, after))};
}

// The curvature of the labels between two crossings, from those before and after them (null: there is none).
Curvature curvature_between(const Crossing* before,
                            const Crossing& first,
                            const Crossing& second,
                            const Crossing* after,
                            float floor) {
  if (!before && !after) return {0, k_any_curvature * k_any_curvature};
  if (!before || !after) {
    const Curvature one =
        before ? curvature_at(*before, first, second, floor) : curvature_at(first, second, *after, floor);
    return {one.value, one.variance + one.value * one.value};
  }
  const Curvature a = curvature_at(*before, first, second, floor),
                  b = curvature_at(first, second, *after, floor);
  const float half = (a.value - b.value) / 2;  // it changes by as much: what a parabola does not follow
  return {(a.value + b.value) / 2, (a.variance + b.variance) / 4 + half * half};
}

// The crossings of one line of camera pixels, neighbours on one surface. Interpolates the pixels between each
// two of them when the one after them is known.
class Run {
 public:
  // The sums of the line's first pixel, and the number of elements from one pixel to the next.
  struct Line {
    float *value, *weight;
    size_t step;
    float floor;
  };

  void add(const Crossing& next, const Line& line) {
    if (count_ > 0) {
      const Crossing& last = last_[static_cast<size_t>(count_ - 1)];
      if (next.edge == last.edge || next.at - last.at >= k_longest) end(line);
    }
    if (count_ == 3) {
      fill(&last_[0], last_[1], last_[2], &next, line);
      last_ = {last_[1], last_[2], next};
      return;
    }
    if (count_ == 2) fill(nullptr, last_[0], last_[1], &next, line);
    last_[static_cast<size_t>(count_++)] = next;
  }

  void end(const Line& line) {
    if (count_ == 3) fill(&last_[0], last_[1], last_[2], nullptr, line);
    if (count_ == 2) fill(nullptr, last_[0], last_[1], nullptr, line);
    count_ = 0;
  }

 private:
  static void fill(const Crossing* before,
                   const Crossing& first,
                   const Crossing& second,
                   const Crossing* after,
                   const Line& line) {
    const int from = static_cast<int>(std::floor(first.at)) + 1, to = static_cast<int>(std::floor(second.at));
    const float length = second.at - first.at, rise = second.label - first.label;
    const float scale = (rise / length) * (rise / length);
    const Curvature curvature =
        length < k_straight ? Curvature{} : curvature_between(before, first, second, after, line.floor);
    const auto [low, high] = std::minmax(first.label, second.label);
    for (int i = from; i <= to; ++i) {
      const float share = (static_cast<float>(i) - first.at) / length;
      const float bend = length * length * share * (1 - share) / 2;
      const float u = std::clamp(first.label + share * rise - bend * curvature.value, low, high);
      const float variance =
          scale * ((1 - share) * (1 - share) * first.variance + share * share * second.variance) +
          bend * bend * curvature.variance + line.floor;
      line.value[static_cast<size_t>(i) * line.step] += u / variance;
      line.weight[static_cast<size_t>(i) * line.step] += 1 / variance;
    }
  }

  std::array<Crossing, 3> last_;
  int count_ = 0;
};

// The labels of neighbouring lines or pixels, and the sums that interpolated values are added to.
struct Place {
  const short *low_a, *end_a, *low_b, *end_b;
};

// One axis with all that its coordinates are computed from.
struct Axis {
  const AxisReading& reading;
  const DifferenceNoise& noise;
  const AxisLabels& labels;
  float floor;
  const cv::Mat& contrast;
};

// Where a pixel lies in the blurred edge of a stripe, whose profile is an error function: standard deviations
// of the blur from the edge's middle.
struct EdgePlace {
  float at = 0;
  float slope = 0;  // derivative by the pixel's difference, 1 / levels
};
EdgePlace place_on_edge(float difference, float contrast) {
  constexpr float k_whole = 0.95F;  // share beyond which noise says nothing about the place
  const float share = std::clamp(difference / contrast, -k_whole, k_whole);
  // Inverse error function by Winitzki's approximation (0.2 %).
  constexpr float k_a = 0.147F, k_two_over_pi_a = 2 / (std::numbers::pi_v<float> * k_a);
  const float log = std::log(1 - share * share), half = k_two_over_pi_a + log / 2;
  const float square = 2 * (std::sqrt(half * half - log / k_a) - half);
  return {std::copysign(std::sqrt(std::max(0.0F, square)), share),
          std::sqrt(std::numbers::pi_v<float> / 2) * std::exp(square / 2) / contrast};
}

// Finds where the difference of the bit that changes at `edge` crosses zero between pixels a and b; `at` is
// the position along the line.
Crossing crossing(const Axis& axis, int edge, cv::Point a, cv::Point b, int at) {
  const size_t bit = axis.reading.bit_at_edge(edge);
  const cv::Mat& difference = axis.reading.differences[bit];
  float first = difference.ptr<short>(a.y)[a.x], second = difference.ptr<short>(b.y)[b.x];
  if ((first > 0) == (second > 0)) return {};
  float label = static_cast<float>(edge) - 0.5F;
  if (!axis.reading.shake.empty()) {
    const PairShake& shake = axis.reading.shake[bit];
    const float more = static_cast<float>(shake.gain_difference / 2) *
                       static_cast<float>(axis.noise.sum.ptr<ushort>(a.y)[a.x]);
    first -= more;
    second -= more;
    const cv::Vec2f slope = axis.reading.slopes.at(a.x, a.y);
    const float moved =
        slope[0] * static_cast<float>(shake.shift_px.x()) + slope[1] * static_cast<float>(shake.shift_px.y());
    if (!std::isnan(moved)) label += moved;
  }
  const EdgePlace from = place_on_edge(first, axis.contrast.at<short>(a)),
                  to = place_on_edge(second, axis.contrast.at<short>(b));
  const float step = from.at - to.at, share = from.at / step;
  if (!(share > -1 && share < 2)) return {};  // the pair's two images had too different light
  const float off_a = (1 - share) * from.slope, off_b = share * to.slope;
  const float variance = axis.noise.at(a.x, a.y) * (off_a * off_a + off_b * off_b) / (step * step);
  return {edge, static_cast<float>(at) + share, label, variance};
}

// Moves from pixel a to pixel b of a line.
void pass(const Axis& axis,
          const Place& labels,
          cv::Point a,
          cv::Point b,
          int at,
          Run* run,
          const Run::Line& line) {
  const int low_a = labels.low_a[a.x], end_a = labels.end_a[a.x];
  const int low_b = labels.low_b[b.x], end_b = labels.end_b[b.x];
  if (low_a == low_b && end_a == end_b && low_a != end_a) return;
  if (nested(low_a, end_a, low_b, end_b)) return;  // the same label, perhaps a coarser one
  const int edge = edge_between(low_a, end_a, low_b, end_b);
  const Crossing next = edge > 0 ? crossing(axis, edge, a, b, at) : Crossing{};
  if (next.edge >= 0)
    run->add(next, line);
  else
    run->end(line);
}

void along_rows(const Axis& axis, Sums* sums) {
  for (int y = 0; y < axis.labels.low.rows; ++y) {
    const short *low = axis.labels.low.ptr<short>(y), *end = axis.labels.end.ptr<short>(y);
    const Run::Line line = {sums->value.ptr<float>(y), sums->weight.ptr<float>(y), 1, axis.floor};
    Run run;
    for (int x = 0; x + 1 < axis.labels.low.cols; ++x)
      pass(axis, {low, end, low, end}, {x, y}, {x + 1, y}, x, &run, line);
    run.end(line);
  }
}

void along_columns(const Axis& axis, Sums* sums) {
  const AxisLabels& labels = axis.labels;
  const auto columns = static_cast<size_t>(labels.low.cols);
  std::vector<Run> runs(columns);
  const auto line = [&](size_t x) {
    return Run::Line{sums->value.ptr<float>() + x, sums->weight.ptr<float>() + x, columns, axis.floor};
  };
  for (int y = 0; y + 1 < labels.low.rows; ++y) {
    const Place place = {labels.low.ptr<short>(y), labels.end.ptr<short>(y), labels.low.ptr<short>(y + 1),
                         labels.end.ptr<short>(y + 1)};
    for (int x = 0; x < labels.low.cols; ++x)
      pass(axis, place, {x, y}, {x, y + 1}, y, &runs[static_cast<size_t>(x)], line(static_cast<size_t>(x)));
  }
  for (size_t x = 0; x < columns; ++x) runs[x].end(line(x));
}

// A plane u = offset + slope . (x, y) through points; nullopt when they lie on a line.
struct LabelPlane {
  Eigen::Vector3d values;
  Eigen::Matrix3d inverse;
};
std::optional<LabelPlane> plane_through(const std::vector<Eigen::Vector3d>& at,
                                        const std::vector<double>& value) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d product = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < at.size(); ++i) {
    normal += at[i] * at[i].transpose();
    product += at[i] * value[i];
  }
  if (!(normal.determinant() > 1e-3 * static_cast<double>(at.size()))) return std::nullopt;
  const Eigen::Matrix3d inverse = normal.inverse();
  return LabelPlane{inverse * product, inverse};
}

// The slope of one field's labels; NaN when they do not lie on one surface.
cv::Vec2f slope_of(const cv::Mat& px, int left, int top) {
  std::vector<Eigen::Vector3d> at;
  std::vector<double> value;
  for (int y = top; y < std::min(px.rows, top + k_field); ++y) {
    for (int x = left; x < std::min(px.cols, left + k_field); ++x) {
      const float label = px.ptr<float>(y)[x];
      if (std::isnan(label)) continue;
      at.emplace_back(1, x - left, y - top);
      value.push_back(label);
    }
  }
  const auto plane = at.size() < k_field * k_field / 4 ? std::nullopt : plane_through(at, value);
  if (!plane) return {k_no_label, k_no_label};
  double squared = 0;
  for (size_t i = 0; i < at.size(); ++i) {
    const double residual = value[i] - plane->values.dot(at[i]);
    squared += residual * residual;
  }
  if (squared > k_one_surface * k_one_surface * static_cast<double>(at.size()))
    return {k_no_label, k_no_label};
  return {static_cast<float>(plane->values[1]), static_cast<float>(plane->values[2])};
}

// The edges of one field's labels, where the camera shows them.
struct FieldEdges {
  std::vector<Eigen::Vector3d> at;   // 1, x, y
  std::vector<double> label, moved;  // `moved`: by the shake, if the stripes follow it
};

// Adds one field: what its edges lie beside a plane is compared with the shake.
void add_field(const FieldEdges& edges, StripeShare* share) {
  if (edges.at.size() < k_least_edges) return;
  const auto labels = plane_through(edges.at, edges.label), moved = plane_through(edges.at, edges.moved);
  if (!labels || !moved) return;
  double squared = 0, product = 0, own = 0;
  for (size_t i = 0; i < edges.at.size(); ++i) {
    const double residual = edges.label[i] - labels->values.dot(edges.at[i]);
    const double expected = edges.moved[i] - moved->values.dot(edges.at[i]);
    own += residual * residual;
    product -= residual * expected;
    squared += expected * expected;
  }
  if (own > k_one_surface * k_one_surface * static_cast<double>(edges.at.size())) return;
  share->product += product;
  share->squared += squared;
  share->residuals += own;
  share->count += static_cast<int>(edges.at.size());
}

}  // namespace

size_t AxisReading::bit_at_edge(int edge) const {
  const int bit = std::countr_zero(static_cast<unsigned>(edge));  // the bit that Gray code changes there
  return static_cast<size_t>(bits() - 1 - bit);
}

LabelSlopes::LabelSlopes(const cv::Mat& px)
    : slopes_((px.rows + k_field - 1) / k_field,
              (px.cols + k_field - 1) / k_field,
              CV_32FC2,
              cv::Scalar(k_no_label, k_no_label)) {
  cv::Mat known = slopes_.clone();
  for (int y = 0; y < known.rows; ++y) {
    for (int x = 0; x < known.cols; ++x) known.at<cv::Vec2f>(y, x) = slope_of(px, x * k_field, y * k_field);
  }
  for (int y = 0; y < known.rows; ++y) {
    for (int x = 0; x < known.cols; ++x) {
      cv::Vec2f sum(0, 0);
      float count = 0;
      const int reach = std::isnan(known.at<cv::Vec2f>(y, x)[0]) ? 1 : 0;
      for (int v = std::max(0, y - reach); v <= std::min(known.rows - 1, y + reach); ++v) {
        for (int u = std::max(0, x - reach); u <= std::min(known.cols - 1, x + reach); ++u) {
          if (std::isnan(known.at<cv::Vec2f>(v, u)[0])) continue;
          sum += known.at<cv::Vec2f>(v, u);
          ++count;
        }
      }
      if (count > 0) slopes_.at<cv::Vec2f>(y, x) = sum / count;
    }
  }
}

cv::Vec2f LabelSlopes::at(int x, int y) const {
  return slopes_.empty() ? cv::Vec2f(k_no_label, k_no_label)
                         : slopes_.ptr<cv::Vec2f>(y / k_field)[x / k_field];
}

AxisLabels::AxisLabels(int rows, int cols)
    : low(rows, cols, CV_16S, cv::Scalar(0)),
      end(rows, cols, CV_16S, cv::Scalar(0)),
      px(rows, cols, CV_32F, cv::Scalar(k_no_label)),
      variance(rows, cols, CV_32F, cv::Scalar(k_no_label)) {}

StripeShare stripe_share(const AxisReading& reading, const AxisLabels& labels) {
  StripeShare share;
  const cv::Size size = labels.low.size();
  for (int top = 0; top < size.height; top += k_field) {
    for (int left = 0; left < size.width; left += k_field) {
      FieldEdges edges;
      const cv::Vec2f slope = reading.slopes.at(left, top);
      if (std::isnan(slope[0])) continue;
      const bool upright = std::abs(slope[0]) > std::abs(slope[1]);
      const cv::Point step = upright ? cv::Point(1, 0) : cv::Point(0, 1);
      for (int y = top; y < std::min(size.height - step.y, top + k_field); ++y) {
        for (int x = left; x < std::min(size.width - step.x, left + k_field); ++x) {
          const cv::Point a(x, y), b = a + step;
          const int edge = edge_between(labels.low.at<short>(a), labels.end.at<short>(a),
                                        labels.low.at<short>(b), labels.end.at<short>(b));
          if (edge <= 0) continue;
          const size_t bit = reading.bit_at_edge(edge);
          const float first = reading.differences[bit].at<short>(a),
                      second = reading.differences[bit].at<short>(b);
          if ((first > 0) == (second > 0)) continue;
          const double part = first / (first - second);
          const Eigen::Vector2d& shift = reading.shake[bit].shift_px;
          edges.at.emplace_back(1, x - left + part * step.x, y - top + part * step.y);
          edges.label.push_back(edge - 0.5);
          edges.moved.push_back(slope[0] * shift.x() + slope[1] * shift.y());
        }
      }
      add_field(edges, &share);
    }
  }
  return share;
}

void refine_between_edges(const AxisReading& reading,
                          const DifferenceNoise& noise,
                          const cv::Mat& contrast,
                          double floor_px,
                          AxisLabels* labels) {
  const Axis axis{reading, noise, *labels, static_cast<float>(floor_px * floor_px), contrast};
  Sums sums{cv::Mat(labels->low.size(), CV_32F, cv::Scalar(0)),
            cv::Mat(labels->low.size(), CV_32F, cv::Scalar(0))};
  along_rows(axis, &sums);
  along_columns(axis, &sums);
  for (int y = 0; y < sums.value.rows; ++y) {
    const float *value = sums.value.ptr<float>(y), *weight = sums.weight.ptr<float>(y);
    float *px = labels->px.ptr<float>(y), *variance = labels->variance.ptr<float>(y);
    for (int x = 0; x < sums.value.cols; ++x) {
      // The two directions share noise and floor, so the variance is that of the better one.
      if (weight[x] * variance[x] <= 1 || std::isnan(px[x])) continue;
      px[x] = value[x] / weight[x];
      variance[x] = std::max(1 / weight[x], axis.floor);
    }
  }
}

}  // namespace limn::calib
