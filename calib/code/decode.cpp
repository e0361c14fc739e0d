#include "calib/code/decode.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>
#include <span>

#include "calib/code/phase.h"
#include "calib/code/subpixel.h"
#include "core/image_io.h"
#include "core/median.h"

namespace limn::calib {
namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();
constexpr float k_infinite = std::numeric_limits<float>::infinity();
constexpr int k_unlit = 255;          // a value in an image of least steps: not illuminated
constexpr int k_settle_passes = 2;    // pixels without a label are few, their regions small
constexpr float k_calm_px = 12;       // range of the neighbours' labels on one surface, projector pixels
constexpr float k_reach_px = 4;       // labels within this distance of the neighbours' mean are candidates
constexpr int k_wide_stripe_px = 16;  // stripes that blur weakens at their edges only
// Difference of a label from its neighbours' mean that is allowed in addition to their slope.
constexpr float k_neighbours_px = 0.5F;
// px^2: variance of labels 4 or more pixels wide, whose centre may be further off than their neighbours.
constexpr float k_coarse_var = 1;
constexpr double k_blocks_from_median = 1.5;  // limit of an outlier where labels are several pixels wide
constexpr float k_neighbours_var = 0.26F;     // px^2: variance of one of two neighbouring labels
// Half squared standard deviations of noise for a label: 4 standard deviations.
constexpr float k_max_cost = 8;

// The code of an axis as it is shown: Gray code, whose bits above `base` may be combined with that bit.
struct Code {
  int bits = 0;    // number of bits shown
  int lowest = 0;  // finest bit shown: labels are blocks of 2^lowest projector pixels
  int base = 32;
  int blocks = 0;  // number of labels on the axis

  unsigned above_base() const { return base < bits ? (1U << bits) - (2U << base) : 0; }
  unsigned exchanged(unsigned code) const { return (code >> base & 1U) != 0 ? code ^ above_base() : code; }
  unsigned displayed_bit(unsigned block) const {
    const unsigned gray = block ^ (block >> 1);
    return base < bits ? exchanged(gray) : gray;
  }
  unsigned block(unsigned displayed_bit) const {
    unsigned gray = base < bits ? exchanged(displayed_bit) : displayed_bit;
    for (unsigned shift = 1; shift < 16; shift *= 2) gray ^= gray >> shift;
    return gray;
  }
  // Bits of the Gray code that are unsure when these bits of the shown code are.
  unsigned unsure(unsigned displayed_bit) const {
    return base < bits && (displayed_bit >> base & 1U) != 0 ? displayed_bit | above_base() : displayed_bit;
  }
};

// Signs of all pixels' bits, and which of them are unsure: CV_16U, most significant bit shown first.
struct BitPlanes {
  cv::Mat code, unsure;
};

// Levels by which a pair must differ to be sure; k_unlit where the projector's direct light does not reach.
struct LeastSteps {
  cv::Mat fine;  // CV_8U: for bits that blur weakens
  cv::Mat wide;  // CV_8U: for wide stripes, and for the bits of xor's base
};

BitPlanes bit_planes(const AxisReading& axis, const Code& code, const LeastSteps& steps) {
  const cv::Size size = steps.fine.size();
  BitPlanes planes{cv::Mat(size, CV_16U, cv::Scalar(0)), cv::Mat(size, CV_16U, cv::Scalar(0))};
  for (int y = 0; y < size.height; ++y) {
    ushort *signs = planes.code.ptr<ushort>(y), *unsure = planes.unsure.ptr<ushort>(y);
    for (int i = 0; i < axis.bits(); ++i) {
      const int bit = code.bits - 1 - i;
      const bool wide =
          code.base < code.bits ? bit >= code.base : (2 << (bit + code.lowest)) >= k_wide_stripe_px;
      const short* difference = axis.differences[static_cast<size_t>(i)].ptr<short>(y);
      const uchar* step = (wide ? steps.wide : steps.fine).ptr<uchar>(y);
      for (int x = 0; x < size.width; ++x) {
        const auto d = difference[x];
        const auto magnitude = static_cast<short>(d < 0 ? -d : d);
        signs[x] = static_cast<ushort>(signs[x] << 1 | (d > 0 ? 1 : 0));
        unsure[x] = static_cast<ushort>(unsure[x] << 1 | (magnitude < step[x] ? 1 : 0));
      }
    }
  }
  return planes;
}

struct Label {
  int low = 0, end = 0;  // by the signs; low = end: no label
  float centre = k_nan, variance = k_nan;
};

// The label that the bits give, in blocks; none when they do not determine it to 2^max_coarse neighbours.
Label label_of(unsigned displayed_bit, unsigned shown_unsure, const Code& code, int max_coarse) {
  const unsigned gray_unsure = code.unsure(shown_unsure);
  int coarse = 0;
  while (coarse < code.bits && (gray_unsure >> coarse) & 1U) ++coarse;
  if (coarse > max_coarse) return {};
  const unsigned open = gray_unsure >> coarse;
  const unsigned block = code.block(displayed_bit);
  const unsigned first = block >> coarse;
  unsigned other = first;
  if (open != 0) {
    if ((open & (open - 1)) != 0) return {};  // two unsure bits above sure ones
    // Flipping a bit of Gray code flips that bit of the number and all finer ones.
    other = first ^ ((open << 1) - 1);
    if (std::max(first, other) - std::min(first, other) != 1) return {};
  }
  const int size = 1 << coarse;
  const int low = static_cast<int>(std::min(first, other)) * size;
  const int end = std::min(static_cast<int>(std::max(first, other) + 1) * size, code.blocks);
  if (low >= code.blocks) return {};  // a code that no projector pixel has
  const int own = static_cast<int>(first) * size;
  const double width = end - low;
  return {own, std::min(own + size, std::max(code.blocks, own)), static_cast<float>((low + end - 1) / 2.0),
          static_cast<float>(width * width / 12)};
}

void label_axis(
    const BitPlanes& planes, const Code& code, const cv::Mat& step, int max_coarse, AxisLabels* labels) {
  std::vector<ushort> block_of(size_t{1} << code.bits);
  for (unsigned displayed_bit = 0; displayed_bit < block_of.size(); ++displayed_bit)
    block_of[displayed_bit] = static_cast<ushort>(code.block(displayed_bit));
  for (int y = 0; y < step.rows; ++y) {
    const ushort *signs = planes.code.ptr<ushort>(y), *unsure = planes.unsure.ptr<ushort>(y);
    const uchar* least = step.ptr<uchar>(y);
    short *low = labels->low.ptr<short>(y), *end = labels->end.ptr<short>(y);
    float *px = labels->px.ptr<float>(y), *variance = labels->variance.ptr<float>(y);
    for (int x = 0; x < step.cols; ++x) {
      if (least[x] == k_unlit) continue;
      Label label;
      if (unsure[x] == 0) {
        const int block = block_of[signs[x]];
        if (block < code.blocks) label = {block, block + 1, static_cast<float>(block), 1.0F / 12};
      } else {
        label = label_of(signs[x], unsure[x], code, max_coarse);
      }
      if (std::isnan(label.centre)) continue;
      low[x] = static_cast<short>(label.low);
      end[x] = static_cast<short>(label.end);
      px[x] = label.centre;
      variance[x] = label.variance;
    }
  }
}

// The known coordinates around (x, y), without the pixel's own: their mean (NaN when there are too few, or
// they do not belong to one surface) and their range.
struct Neighbours {
  float mean = k_nan, range = 0;
};
Neighbours around(const cv::Mat& px, int x, int y) {
  constexpr int k_half = 2, k_least = 6;
  float low = k_infinite, high = -k_infinite, sum = 0;
  int count = 0;
  for (int v = std::max(0, y - k_half); v <= std::min(px.rows - 1, y + k_half); ++v) {
    const float* row = px.ptr<float>(v);
    for (int u = std::max(0, x - k_half); u <= std::min(px.cols - 1, x + k_half); ++u) {
      if (std::isnan(row[u]) || (u == x && v == y)) continue;
      low = std::min(low, row[u]);
      high = std::max(high, row[u]);
      sum += row[u];
      ++count;
    }
  }
  if (count < k_least || high - low > k_calm_px) return {};
  return {sum / static_cast<float>(count), high - low};
}

// Removes labels that differ from uniform neighbours, perhaps because noise has flipped a bit of a dark
// pixel, and marks them.
void doubt(float limit, AxisLabels* labels, cv::Mat* doubted) {
  const cv::Mat before = labels->px.clone();
  for (int y = 1; y + 1 < before.rows; ++y) {
    const float *row = before.ptr<float>(y), *up = before.ptr<float>(y - 1), *down = before.ptr<float>(y + 1);
    for (int x = 1; x + 1 < before.cols; ++x) {
      const auto apart = [&](float other) { return std::abs(other - row[x]) > limit ? 1 : 0; };
      if (apart(row[x - 1]) + apart(row[x + 1]) + apart(up[x]) + apart(down[x]) < 2) continue;
      const float near = around(before, x, y).mean;
      if (std::isnan(near) || std::abs(near - row[x]) <= limit) continue;
      labels->px.ptr<float>(y)[x] = labels->variance.ptr<float>(y)[x] = k_nan;
      labels->low.ptr<short>(y)[x] = labels->end.ptr<short>(y)[x] = 0;
      doubted->ptr<uchar>(y)[x] = 1;
    }
  }
}

// How unlikely a label is: noise must have flipped every bit that reads differently.
float cost_of(const AxisReading& axis, unsigned displayed_bit, int x, int y, float variance) {
  float cost = 0;
  for (int i = 0; i < axis.bits(); ++i) {
    const float d = axis.differences[static_cast<size_t>(i)].ptr<short>(y)[x];
    const bool set = (displayed_bit >> (axis.bits() - 1 - i) & 1U) != 0;
    if (set != (d > 0)) cost += d * d / (2 * variance);
  }
  return cost;
}

// Decides illuminated pixels whose bits do not determine their label: candidates near the neighbours' labels
// are compared by their likelihood.
void settle_by_neighbours(const AxisReading& axis,
                          const Code& code,
                          const DifferenceNoise& noise,
                          const cv::Mat& step,
                          AxisLabels* labels) {
  // Combined bits (xor) are all unsure at the base's edges, and the possible labels are then a stripe apart:
  // the neighbours decide. In Gray code the possible labels are adjacent; the neighbours would only bias the
  // choice.
  const bool exchanged = code.base < code.bits;
  const cv::Mat before = labels->px.clone();
  const float scale = 1.0F / static_cast<float>(1 << code.lowest);
  for (int y = 0; y < step.rows; ++y) {
    const uchar* least = step.ptr<uchar>(y);
    float *px = labels->px.ptr<float>(y), *variance = labels->variance.ptr<float>(y);
    for (int x = 0; x < step.cols; ++x) {
      if (least[x] == k_unlit || variance[x] <= k_coarse_var) continue;  // NaN: no label
      const auto [near, range] = around(before, x, y);
      if (std::isnan(near)) continue;
      const float doubt =
          k_neighbours_px * scale + range / 4;  // standard deviation: on a slope near is its middle
      const float reach = std::max(1.0F, k_reach_px * scale);
      const int from = std::max(0, static_cast<int>(std::floor(near - reach)));
      const int to = std::min(code.blocks - 1, static_cast<int>(std::ceil(near + reach)));
      float total = 0, sum = 0, squares = 0, best = 0;
      int likeliest = 0;
      for (int n = from; n <= to; ++n) {
        const float cost = cost_of(axis, code.displayed_bit(static_cast<unsigned>(n)), x, y, noise.at(x, y));
        if (cost > k_max_cost) continue;
        const float at = static_cast<float>(n) - near;
        const float likely = std::exp(-cost - (exchanged ? at * at / (2 * doubt * doubt) : 0));
        if (likely > best) likeliest = n;
        best = std::max(best, likely);
        total += likely;
        sum += likely * at;
        squares += likely * at * at;
      }
      if (total == 0) continue;
      const float mean = sum / total;
      px[x] = near + mean;
      const float spread = squares / total - mean * mean;
      variance[x] = spread + 1.0F / 12;
      if (!exchanged || spread > k_neighbours_var) continue;
      labels->low.ptr<short>(y)[x] = static_cast<short>(likeliest);  // labels at its edges count, too
      labels->end.ptr<short>(y)[x] = static_cast<short>(likeliest + 1);
    }
  }
}

// Median of the labels around (x, y), for each axis.
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
  const std::span labelled_columns(columns.data(), count), labelled_rows(rows.data(), count);
  return {value_of_rank(&labelled_columns, count / 2), value_of_rank(&labelled_rows, count / 2)};
}

bool apart(const cv::Vec2f& a, const cv::Vec2f& b, double limit) {
  return std::abs(a[0] - b[0]) > limit || std::abs(a[1] - b[1]) > limit;
}

// Whether every labelled pixel of the 3x3 neighbourhood is close, so that the median is not needed.
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

// Number of marked pixels that have no label in the end.
int count_unlabelled(const cv::Mat& marked, const cv::Mat& labels) {
  int count = 0;
  for (int y = 0; y < marked.rows; ++y) {
    for (int x = 0; x < marked.cols; ++x)
      count += marked.ptr<uchar>(y)[x] != 0 && std::isnan(labels.ptr<cv::Vec2f>(y)[x][0]) ? 1 : 0;
  }
  return count;
}

// Whether a pair's stripes are fine enough that indirect light does not follow them, and wide enough that the
// lens resolves them: 4 to 32 projector pixels; for a small projector all pairs, for xor those that are as
// fine as its base. `bit` counts from the projector's finest.
bool measures_direct_light(int bit, const Code& code) {
  if (code.base < code.bits) return bit >= code.base;
  return code.bits <= 5 || (bit >= 1 && bit <= std::max(4, code.lowest));
}

// Direct light: the mean size of image minus inverse over the bits that measure it.
struct DirectLight {
  cv::Mat sum;  // CV_16U
  int bits = 0;
  void add_pair(const cv::Mat& image, const cv::Mat& inverse) {
    cv::Mat magnitude;
    cv::absdiff(image, inverse, magnitude);
    cv::add(sum, magnitude, sum, cv::noArray(), CV_16U);
    ++bits;
  }
};

// One series while it is read.
struct Series {
  const Patterns& patterns;
  const std::vector<std::filesystem::path>& files;
  cv::Size size;
  CaptureQualityProbe probe;
  DirectLight direct;
  int used_bits;                             // those of white, so that all images have the same levels
  std::optional<ShakeReference> shake = {};  // set after white and black; pairs are compared with it

  Result<cv::Mat> read(int index) {
    LIMN_TRY(const cv::Mat image,
             read_shot(files[static_cast<size_t>(index)], size.width, size.height, used_bits));
    probe.add_image(index, image);
    return image;
  }
};

// Reads image minus inverse of an axis's bits, from image number `first` on. `both`: white plus black; where
// inverses are not shown, they are computed as `both` minus the image.
Status read_bits(int first, const Code& code, const cv::Mat& both, Series* series, AxisReading* axis) {
  const int step = series->patterns.images_of_bit();
  for (int i = 0; i < code.bits; ++i) {
    LIMN_TRY(const cv::Mat image, series->read(first + step * i));
    cv::Mat inverse;
    if (series->patterns.options.inverses) {
      LIMN_TRY(inverse, series->read(first + step * i + 1));
    } else {
      cv::subtract(both, image, inverse, cv::noArray(), CV_16S);
      inverse.convertTo(inverse, CV_8U);
    }
    cv::Mat difference;
    cv::subtract(image, inverse, difference, cv::noArray(), CV_16S);
    axis->differences.push_back(difference);
    if (measures_direct_light(code.lowest + code.bits - 1 - i, code)) series->direct.add_pair(image, inverse);
    if (series->shake) axis->shake.push_back(series->shake->measure(image, inverse));
  }
  return {};
}

// The steps of one axis. `shake`: by what each step and its inverse, half a wave later, differ from white and
// black.
Result<PhaseReading> read_steps(int first, Series* series, std::vector<PairShake>* shake) {
  const int steps = series->patterns.steps(), half = steps / 2;
  std::vector<cv::Mat> first_half;  // until their inverses are read
  PhaseReading reading(series->size.height, series->size.width, series->patterns.options.period_px,
                       series->patterns.steps());
  for (int k = 0; k < series->patterns.steps(); ++k) {
    LIMN_TRY(const cv::Mat image, series->read(first + k));
    reading.add_step(k, image);
    if (!series->shake || steps % 2 != 0) continue;
    if (k < half)
      first_half.push_back(image);
    else
      shake->push_back(series->shake->measure(first_half[static_cast<size_t>(k - half)], image));
  }
  return reading;
}

// The minimum steps of the bits, from the direct light. A pixel is illuminated when the projector's direct
// light reaches it; white minus black also contains what the room reflects. Combined bits (xor) all cross
// zero at the base's edges, so that only noise decides between them there; their stripes lose more than half
// of their light to blur, and none of it is indirect.
LeastSteps least_steps(const DirectLight& direct,
                       bool exchanged,
                       const DifferenceNoise& noise,
                       const DecodeOptions& options,
                       Decoded* decoded) {
  constexpr double k_exchanged_noise = 2;     // standard deviations of a difference
  constexpr double k_exchanged_direct = 0.4;  // contrast of stripes of 2 pixels blurred by 0.6
  const double min_direct = exchanged ? k_exchanged_direct * options.min_direct : options.min_direct;
  // Standard deviations of a difference: the mean of several is then sure.
  constexpr double k_lit_noise = 1.4;
  const cv::Size size = decoded->contrast.size();
  LeastSteps steps{cv::Mat(size, CV_8U, cv::Scalar(k_unlit)), cv::Mat(size, CV_8U, cv::Scalar(k_unlit))};
  for (int y = 0; y < size.height; ++y) {
    const uchar* contrast = decoded->contrast.ptr<uchar>(y);
    const ushort* sum = direct.sum.ptr<ushort>(y);
    for (int x = 0; x < size.width; ++x) {
      const double all = contrast[x];
      if (all < options.min_contrast) continue;
      ++decoded->contrasted;
      const double own = sum[x] / static_cast<double>(direct.bits);
      const double least_own = std::max(options.min_step, k_lit_noise * std::sqrt(noise.at(x, y)));
      if (own < min_direct * all || own < least_own) continue;
      ++decoded->lit;
      const auto least = [&](double step) {
        return static_cast<uchar>(std::min(k_unlit - 1.0, std::ceil(std::max(options.min_step, step))));
      };
      steps.fine.ptr<uchar>(y)[x] = least(options.min_share * own);
      steps.wide.ptr<uchar>(y)[x] =
          least(exchanged ? k_exchanged_noise * std::sqrt(noise.at(x, y)) : options.min_coarse_share * own);
    }
  }
  return steps;
}

// Noise of image minus inverse. Without inverses the difference is twice the image minus white and black:
// three times the variance.
DifferenceNoise difference_noise(const cv::Mat& white,
                                 const cv::Mat& black,
                                 bool inverses,
                                 const IntensityNoise& noise) {
  const double times = inverses ? 1 : 3;
  DifferenceNoise differences;
  cv::add(white, black, differences.sum, cv::noArray(), CV_16U);
  for (int sum = 0; sum <= 510; ++sum)
    differences.variance.push_back(static_cast<float>(times * (2 * noise.read + noise.per_level * sum)));
  return differences;
}

AxisLabels labels_of(const AxisReading& axis,
                     const Code& code,
                     const LeastSteps& steps,
                     const DifferenceNoise& noise,
                     const DecodeOptions& options,
                     cv::Mat* doubted) {
  AxisLabels labels(steps.fine.rows, steps.fine.cols);
  const int max_coarse = std::max(0, options.max_coarse_bits - code.lowest);
  label_axis(bit_planes(axis, code, steps), code, steps.fine, max_coarse, &labels);
  doubt(static_cast<float>(options.max_from_median), &labels, doubted);
  for (int pass = 0; pass < k_settle_passes; ++pass)
    settle_by_neighbours(axis, code, noise, steps.fine, &labels);
  return labels;
}

// Largest standard deviation of the share of a shake that the stripes follow.
constexpr double k_most_share_stddev = 0.2;

// Says in the readings what a shake has done to their pairs: the displacement as far as the stripes follow
// it.
void settle_shake(const std::vector<AxisLabels>& labels, Shake* shake, std::array<AxisReading, 2>* axes) {
  StripeShare sum;
  for (size_t i = 0; i < 2; ++i) {
    AxisReading& axis = (*axes)[i];
    axis.shake.clear();
    if (!shake->shakes && !shake->flickers) continue;
    axis.shake = shake->axes[i];
    if (!shake->shakes || axis.bits() == 0) continue;
    axis.slopes = LabelSlopes(labels[i].px);
    const StripeShare one = stripe_share(axis, labels[i]);
    sum.product += one.product;
    sum.squared += one.squared;
    sum.residuals += one.residuals;
    sum.count += one.count;
  }
  // Without an answer the camera has moved: its stand is the lighter one.
  if (sum.count > 0 && sum.residuals / sum.count < k_most_share_stddev * k_most_share_stddev * sum.squared)
    shake->share = std::clamp(sum.product / sum.squared, 0.0, 1.0);
  for (AxisReading& axis : *axes) {
    for (PairShake& pair : axis.shake) pair.shift_px *= shake->share;
  }
}

// What a shake has done to the steps of an axis, as settle_shake() says it of its bits.
std::vector<PairShake> settled(std::vector<PairShake> pairs, const Shake& shake) {
  if (!shake.shakes && !shake.flickers) return {};
  for (PairShake& pair : pairs) {
    pair.shift_px += shake.white_shift_px;
    pair.shift_px *= shake.shakes ? shake.share : 0;
    if (!shake.flickers || !std::isfinite(pair.gain_stddev)) pair.gain_difference = 0;
  }
  return pairs;
}

// Converts blocks of projector pixels to pixels.
void to_pixels(double block, AxisLabels* labels) {
  if (block == 1) return;
  labels->px.convertTo(labels->px, CV_32F, block, (block - 1) / 2);
  labels->variance *= block * block;
}

// Share of the illuminated pixels whose finest bit is unsure, on the axis with more of them.
double unsure_finest(const AxisReading& columns, const AxisReading& rows, const cv::Mat& step, int lit) {
  double worst = 0;
  for (const AxisReading* axis : {&columns, &rows}) {
    if (axis->bits() == 0) continue;
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

// The labels of an axis that was not shown: every pixel has one, until the series is decoded.
AxisLabels any_label(const cv::Size& size) {
  AxisLabels labels(size.height, size.width);
  labels.px.setTo(0);
  labels.variance.setTo(k_infinite);
  return labels;
}

// Says that the rows are unknown.
void forget_rows(Decoded* decoded) {
  for (int y = 0; y < decoded->px_projector.rows; ++y) {
    auto* px = decoded->px_projector.ptr<cv::Vec2f>(y);
    for (int x = 0; x < decoded->px_projector.cols; ++x) px[x][1] = k_nan;
  }
}

// Combines the axes where both have labels; returns the number of these pixels.
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

// Image minus inverse on the two sides of a stripe's edge, levels, CV_16S, at least 1. In Gray code some bit
// has no edge near a pixel, so that its difference is the whole one; of combined bits (xor) all have their
// edges together.
cv::Mat edge_contrast(const std::array<AxisReading, 2>& axes,
                      PatternCode code,
                      const cv::Mat& white_less_black) {
  cv::Mat contrast;
  if (code == PatternCode::exclusive_or)
    white_less_black.convertTo(contrast, CV_16S);
  else
    contrast = cv::Mat(white_less_black.size(), CV_16S, cv::Scalar(1));
  for (const AxisReading& axis : axes)
    for (const cv::Mat& difference : axis.differences) contrast = cv::max(contrast, cv::abs(difference));
  return cv::max(contrast, 1);
}

}  // namespace

Result<cv::Mat> read_shot(const std::filesystem::path& path, int width, int height, int used_bits) {
  LIMN_TRY(cv::Mat image, read_grey_image(path, used_bits));
  if (image.cols != width || image.rows != height)
    return error("{}: expected an image of {}x{} pixels, found {}x{}. Capture this pose again.",
                 path.string(), width, height, image.cols, image.rows);
  return image;
}

Result<Decoded> decode(const Patterns& patterns,
                       const std::vector<std::filesystem::path>& images,
                       int width,
                       int height,
                       const DecodeOptions& options) {
  LIMN_CHECK(static_cast<int>(images.size()) == patterns.count());
  LIMN_TRY(const int used_bits, find_used_bits(images[static_cast<size_t>(patterns.white())]));
  Series series{patterns,
                images,
                cv::Size(width, height),
                CaptureQualityProbe(patterns, width, height),
                {cv::Mat(height, width, CV_16U, cv::Scalar(0))},
                used_bits};
  LIMN_TRY(const cv::Mat white, series.read(patterns.white()));
  LIMN_TRY(const cv::Mat black, series.read(patterns.black()));
  const int lowest = patterns.lowest_bit(), block = patterns.block_px();
  const auto blocks = [&](int size) { return (size + block - 1) / block; };
  const std::array<Code, 2> codes = {
      Code{patterns.column_bits(), lowest, patterns.base_bit(), blocks(patterns.width)},
      Code{patterns.row_bits(), lowest, patterns.base_bit(), blocks(patterns.height)}};
  std::array<AxisReading, 2> axes;
  cv::Mat both;
  cv::add(white, black, both, cv::noArray(), CV_16S);
  if (patterns.options.inverses) series.shake.emplace(white, black);
  LIMN_TRY_STATUS(read_bits(0, codes[0], both, &series, &axes[0]));
  LIMN_TRY_STATUS(read_bits(patterns.first_row_bit(), codes[1], both, &series, &axes[1]));
  std::vector<PhaseReading> waves;
  std::array<std::vector<PairShake>, 2> of_steps;
  for (int axis = 0; axis < 2 && patterns.steps() > 0; ++axis) {
    LIMN_TRY(PhaseReading reading, read_steps(patterns.first_step() + axis * patterns.steps(), &series,
                                              &of_steps[static_cast<size_t>(axis)]));
    waves.push_back(std::move(reading));
  }
  Decoded decoded;
  cv::subtract(white, black, decoded.contrast);
  decoded.quality = series.probe.quality(images, shake_of({axes[0].shake, axes[1].shake}));
  const DifferenceNoise noise =
      difference_noise(white, black, patterns.options.inverses, decoded.quality.noise);
  const LeastSteps steps =
      least_steps(series.direct, patterns.code == PatternCode::exclusive_or, noise, options, &decoded);
  std::vector<AxisLabels> labels;
  cv::Mat doubted(height, width, CV_8U, cv::Scalar(0));
  for (size_t axis = 0; axis < 2; ++axis) {
    labels.push_back(axes[axis].bits() > 0
                         ? labels_of(axes[axis], codes[axis], steps, noise, options, &doubted)
                         : any_label(steps.fine.size()));
  }
  settle_shake(labels, &decoded.quality.shake, &axes);
  const cv::Mat contrast = edge_contrast(axes, patterns.code, decoded.contrast);
  for (size_t axis = 0; axis < 2; ++axis) {
    if (axes[axis].bits() > 0)
      refine_between_edges(axes[axis], noise, contrast, options.floor_px, &labels[axis]);
    to_pixels(block, &labels[axis]);
    if (waves.empty()) continue;
    const std::vector<PairShake> shake = settled(std::move(of_steps[axis]), decoded.quality.shake);
    refine_by_phase(waves[axis], noise, options.floor_px, shake, &labels[axis]);
  }
  decoded.decoded = join(labels[0], labels[1], &decoded);
  const int contradicted = count_unlabelled(doubted, decoded.px_projector);
  // Neighbouring labels are a block apart.
  const double limit = std::max(options.max_from_median, k_blocks_from_median * block);
  const int removed = remove_outliers(&decoded.px_projector, waves.empty() ? limit : options.max_from_median);
  decoded.decoded -= removed;
  if (axes[1].bits() == 0) forget_rows(&decoded);
  decoded.outliers = contradicted + removed;
  decoded.quality.unsure_finest = unsure_finest(axes[0], axes[1], steps.fine, decoded.lit);
  return decoded;
}

}  // namespace limn::calib
