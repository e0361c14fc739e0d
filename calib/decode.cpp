#include "calib/decode.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "calib/subpixel.h"
#include "core/picture.h"

namespace limn::calib {
namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();
constexpr float k_infinite = std::numeric_limits<float>::infinity();
constexpr int k_unlit = 255;        // in a picture of least steps
constexpr int k_settle_passes = 2;  // pixels without a label are few and small
constexpr float k_calm_px = 12;     // range of the neighbours' labels on one surface, projector pixels
constexpr float k_reach_px = 4;     // how far from their mean a label is looked for

unsigned binary_of_gray(unsigned gray) {
  for (unsigned shift = 1; shift < 16; shift *= 2) gray ^= gray >> shift;
  return gray;
}

unsigned gray_of_binary(unsigned binary) { return binary ^ (binary >> 1); }

// The bits of one axis at one pixel: readings, and which of them are unsure.
struct PixelBits {
  unsigned code = 0, unsure = 0;
};

PixelBits bits_at(const AxisReading& axis, int y, int x, int step) {
  PixelBits bits;
  for (const cv::Mat& bit : axis.differences) {
    const int difference = bit.ptr<short>(y)[x];
    bits.code = bits.code << 1 | (difference > 0 ? 1U : 0U);
    bits.unsure = bits.unsure << 1 | (std::abs(difference) < step ? 1U : 0U);
  }
  return bits;
}

struct Label {
  int low = 0, end = 0;  // by the signs; low = end: none
  float centre = k_nan, variance = k_nan;
};

// The label that sure bits give; without one when they do not settle it to 2^max_coarse neighbours.
Label label_of(const PixelBits& pixel, int bits, int size, int max_coarse) {
  int coarse = 0;
  while (coarse < bits && (pixel.unsure >> coarse) & 1U) ++coarse;
  if (coarse > max_coarse) return {};
  const unsigned open = pixel.unsure >> coarse;
  const unsigned first = binary_of_gray(pixel.code >> coarse);
  unsigned other = first;
  if (open != 0) {
    if ((open & (open - 1)) != 0) return {};  // two unsure bits above sure ones
    other = binary_of_gray((pixel.code >> coarse) ^ open);
    if (std::max(first, other) - std::min(first, other) != 1) return {};
  }
  const int block = 1 << coarse;
  const int low = static_cast<int>(std::min(first, other)) * block;
  const int end = std::min(static_cast<int>(std::max(first, other) + 1) * block, size);
  if (low >= size) return {};  // a code that no projector pixel has
  const int own = static_cast<int>(first) * block;
  const double width = end - low;
  return {own, std::min(own + block, std::max(size, own)), static_cast<float>((low + end - 1) / 2.0),
          static_cast<float>(width * width / 12)};
}

void label_axis(const AxisReading& axis, const cv::Mat& step, int max_coarse, AxisLabels* labels) {
  for (int y = 0; y < step.rows; ++y) {
    for (int x = 0; x < step.cols; ++x) {
      const int least = step.ptr<uchar>(y)[x];
      if (least == k_unlit) continue;
      const Label label = label_of(bits_at(axis, y, x, least), axis.bits(), axis.size, max_coarse);
      if (std::isnan(label.centre)) continue;
      labels->low.ptr<int>(y)[x] = label.low;
      labels->end.ptr<int>(y)[x] = label.end;
      labels->px.ptr<float>(y)[x] = label.centre;
      labels->variance.ptr<float>(y)[x] = label.variance;
    }
  }
}

// The mean of the known coordinates around (x, y); NaN when there are few.
float around(const cv::Mat& px, int x, int y) {
  constexpr int k_half = 2, k_least = 6;
  float low = k_infinite, high = -k_infinite, sum = 0;
  int count = 0;
  for (int v = std::max(0, y - k_half); v <= std::min(px.rows - 1, y + k_half); ++v) {
    const float* row = px.ptr<float>(v);
    for (int u = std::max(0, x - k_half); u <= std::min(px.cols - 1, x + k_half); ++u) {
      if (std::isnan(row[u])) continue;
      low = std::min(low, row[u]);
      high = std::max(high, row[u]);
      sum += row[u];
      ++count;
    }
  }
  return count >= k_least && high - low <= k_calm_px ? sum / static_cast<float>(count) : k_nan;
}

// Lit pixels of which too many bits are unsure: every label near the neighbours' that agrees with all sure
// bits is possible, and their middle is taken.
void settle_by_neighbours(const AxisReading& axis, const cv::Mat& step, AxisLabels* labels) {
  const cv::Mat before = labels->px.clone();
  for (int y = 0; y < step.rows; ++y) {
    for (int x = 0; x < step.cols; ++x) {
      const int least = step.ptr<uchar>(y)[x];
      if (least == k_unlit || !std::isnan(before.ptr<float>(y)[x])) continue;
      const float near = around(before, x, y);
      if (std::isnan(near)) continue;
      const PixelBits bits = bits_at(axis, y, x, least);
      const int from = std::max(0, static_cast<int>(std::floor(near - k_reach_px)));
      const int to = std::min(axis.size - 1, static_cast<int>(std::ceil(near + k_reach_px)));
      int count = 0, low = to, high = from;
      for (int n = from; n <= to; ++n) {
        if (((gray_of_binary(static_cast<unsigned>(n)) ^ bits.code) & ~bits.unsure) != 0) continue;
        ++count;
        low = std::min(low, n);
        high = std::max(high, n);
      }
      if (count == 0) continue;
      const auto width = static_cast<float>(high - low + 1);
      labels->px.ptr<float>(y)[x] = static_cast<float>(low + high) / 2;
      labels->variance.ptr<float>(y)[x] = width * width / 12;
    }
  }
}

// Median of the labels around (x, y), per axis.
cv::Vec2f local_median(const cv::Mat& labels, int x, int y) {
  constexpr int k_half = 2;
  std::array<float, 25> columns{}, rows{};
  size_t count = 0;
  for (int v = std::max(0, y - k_half); v <= std::min(labels.rows - 1, y + k_half); ++v) {
    for (int u = std::max(0, x - k_half); u <= std::min(labels.cols - 1, x + k_half); ++u) {
      const auto& label = labels.at<cv::Vec2f>(v, u);
      if (std::isnan(label[0])) continue;
      columns[count] = label[0];
      rows[count++] = label[1];
    }
  }
  const auto middle = static_cast<std::ptrdiff_t>(count / 2), end = static_cast<std::ptrdiff_t>(count);
  std::nth_element(columns.begin(), columns.begin() + middle, columns.begin() + end);
  std::nth_element(rows.begin(), rows.begin() + middle, rows.begin() + end);
  return {columns[count / 2], rows[count / 2]};
}

bool apart(const cv::Vec2f& a, const cv::Vec2f& b, double limit) {
  return std::abs(a[0] - b[0]) > limit || std::abs(a[1] - b[1]) > limit;
}

// Whether every labelled pixel of the 3x3 neighbourhood is close: then the median is not needed.
bool calm(const cv::Mat& labels, int x, int y, double limit) {
  const auto& own = labels.at<cv::Vec2f>(y, x);
  int neighbours = 0;
  for (int v = std::max(0, y - 1); v <= std::min(labels.rows - 1, y + 1); ++v) {
    for (int u = std::max(0, x - 1); u <= std::min(labels.cols - 1, x + 1); ++u) {
      const auto& label = labels.at<cv::Vec2f>(v, u);
      if (std::isnan(label[0])) continue;
      if (apart(own, label, limit)) return false;
      ++neighbours;
    }
  }
  return neighbours >= 6;
}

int remove_outliers(cv::Mat* labels, double limit) {
  const cv::Mat before = labels->clone();
  std::atomic<int> removed = 0;
  cv::parallel_for_(cv::Range(0, before.rows), [&](const cv::Range& range) {
    int here = 0;
    for (int y = range.start; y < range.end; ++y) {
      for (int x = 0; x < before.cols; ++x) {
        const auto& own = before.at<cv::Vec2f>(y, x);
        if (std::isnan(own[0]) || calm(before, x, y, limit)) continue;
        if (!apart(own, local_median(before, x, y), limit)) continue;
        labels->at<cv::Vec2f>(y, x) = {k_nan, k_nan};
        ++here;
      }
    }
    removed += here;
  });
  return removed;
}

// Whether a bit's stripes are fine enough that light from elsewhere does not follow them, and wide enough
// that the lens shows them: 4 to 32 projector pixels. `bit` counts from the finest.
bool tells_direct_light(int bit, int bits) { return bits <= 5 || (bit >= 1 && bit <= 4); }

// How bright the direct light is: the mean size of picture minus inverse over the bits that tell it.
struct DirectLight {
  cv::Mat sum;  // CV_16U
  int bits = 0;
  void take(const cv::Mat& picture, const cv::Mat& inverse) {
    cv::Mat magnitude;
    cv::absdiff(picture, inverse, magnitude);
    cv::add(sum, magnitude, sum, cv::noArray(), CV_16U);
    ++bits;
  }
};

// Picture minus inverse of an axis' bits.
Status read_axis(const std::vector<std::filesystem::path>& pictures,
                 size_t first,
                 int bits,
                 AxisReading* axis,
                 DirectLight* direct,
                 SeriesProbe* probe) {
  const cv::Size size = direct->sum.size();
  for (int i = 0; i < bits; ++i) {
    const size_t at = first + 2 * static_cast<size_t>(i);
    LIMN_TRY(const cv::Mat picture, read_shot(pictures[at], size.width, size.height));
    LIMN_TRY(const cv::Mat inverse, read_shot(pictures[at + 1], size.width, size.height));
    probe->take(static_cast<int>(at), picture);
    probe->take(static_cast<int>(at) + 1, inverse);
    cv::Mat difference;
    cv::subtract(picture, inverse, difference, cv::noArray(), CV_16S);
    axis->differences.push_back(difference);
    if (tells_direct_light(bits - 1 - i, bits)) direct->take(picture, inverse);
  }
  return {};
}

// Levels by which a bit's two pictures must differ, per pixel. A pixel is lit when the projector's own light
// reaches it: white minus black also holds what the room reflects.
cv::Mat least_steps(const cv::Mat& contrast,
                    const DirectLight& direct,
                    const DecodeOptions& options,
                    int* lit) {
  cv::Mat step(contrast.size(), CV_8U, cv::Scalar(k_unlit));
  for (int y = 0; y < step.rows; ++y) {
    for (int x = 0; x < step.cols; ++x) {
      const double all = contrast.ptr<uchar>(y)[x];
      const double own = direct.sum.ptr<ushort>(y)[x] / static_cast<double>(direct.bits);
      if (all < options.min_contrast || own < std::max(options.min_direct * all, 2 * options.noise)) continue;
      ++*lit;
      step.ptr<uchar>(y)[x] =
          static_cast<uchar>(std::ceil(std::max(options.min_step, options.min_share * own)));
    }
  }
  return step;
}

AxisLabels labels_of(const AxisReading& axis, const cv::Mat& step, const DecodeOptions& options) {
  AxisLabels labels(step.rows, step.cols);
  label_axis(axis, step, options.max_coarse_bits, &labels);
  for (int pass = 0; pass < k_settle_passes; ++pass) settle_by_neighbours(axis, step, &labels);
  refine_between_edges(axis, options.noise, options.floor_px, &labels);
  return labels;
}

// Share of the lit pixels whose finest bit is unsure, on the axis where they are more.
double unsure_finest(const AxisReading& columns, const AxisReading& rows, const cv::Mat& step, int lit) {
  double worst = 0;
  for (const AxisReading* axis : {&columns, &rows}) {
    int unsure = 0;
    for (int y = 0; y < step.rows; ++y) {
      const short* difference = axis->differences.back().ptr<short>(y);
      const uchar* least = step.ptr<uchar>(y);
      for (int x = 0; x < step.cols; ++x) unsure += least[x] != k_unlit && std::abs(difference[x]) < least[x];
    }
    worst = std::max(worst, static_cast<double>(unsure) / std::max(1, lit));
  }
  return worst;
}

// Puts the axes together where both are known; how many pixels that are.
int join(const AxisLabels& u, const AxisLabels& v, Decoded* decoded) {
  decoded->px_projector = cv::Mat(u.px.size(), CV_32FC2, cv::Scalar(k_nan, k_nan));
  decoded->variance = decoded->px_projector.clone();
  int known = 0;
  for (int y = 0; y < u.px.rows; ++y) {
    for (int x = 0; x < u.px.cols; ++x) {
      const cv::Vec2f px(u.px.ptr<float>(y)[x], v.px.ptr<float>(y)[x]);
      if (std::isnan(px[0]) || std::isnan(px[1])) continue;
      decoded->px_projector.ptr<cv::Vec2f>(y)[x] = px;
      decoded->variance.ptr<cv::Vec2f>(y)[x] = {u.variance.ptr<float>(y)[x], v.variance.ptr<float>(y)[x]};
      ++known;
    }
  }
  return known;
}

}  // namespace

Result<cv::Mat> read_shot(const std::filesystem::path& path, int width, int height) {
  LIMN_TRY(cv::Mat picture, read_grey_picture(path));
  if (picture.cols != width || picture.rows != height)
    return error("{}: expected a picture of {}x{} pixels, found {}x{}. Capture this pose again.",
                 path.string(), width, height, picture.cols, picture.rows);
  return picture;
}

Result<Decoded> decode(const Patterns& patterns,
                       const std::vector<std::filesystem::path>& pictures,
                       int width,
                       int height,
                       const DecodeOptions& options) {
  LIMN_CHECK(static_cast<int>(pictures.size()) == patterns.count());
  LIMN_TRY(const cv::Mat white, read_shot(pictures[static_cast<size_t>(patterns.white())], width, height));
  LIMN_TRY(const cv::Mat black, read_shot(pictures[static_cast<size_t>(patterns.black())], width, height));
  SeriesProbe probe(patterns, width, height);
  probe.take(patterns.white(), white);
  probe.take(patterns.black(), black);
  Decoded decoded;
  cv::subtract(white, black, decoded.contrast);
  const int column_bits = patterns.column_bits(), row_bits = patterns.row_bits();
  AxisReading columns{patterns.width, {}}, rows{patterns.height, {}};
  DirectLight direct{cv::Mat(height, width, CV_16U, cv::Scalar(0))};
  LIMN_TRY_STATUS(read_axis(pictures, 0, column_bits, &columns, &direct, &probe));
  LIMN_TRY_STATUS(
      read_axis(pictures, 2 * static_cast<size_t>(column_bits), row_bits, &rows, &direct, &probe));
  const cv::Mat step = least_steps(decoded.contrast, direct, options, &decoded.lit);
  decoded.health = probe.health(pictures);
  const AxisLabels u = labels_of(columns, step, options), v = labels_of(rows, step, options);
  decoded.decoded = join(u, v, &decoded);
  decoded.outliers = remove_outliers(&decoded.px_projector, options.max_from_median);
  decoded.decoded -= decoded.outliers;
  decoded.health.unsure_finest = unsure_finest(columns, rows, step, decoded.lit);
  return decoded;
}

}  // namespace limn::calib
