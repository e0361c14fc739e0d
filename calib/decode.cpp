#include "calib/decode.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>

#include "core/picture.h"

namespace limn::calib {
namespace {

constexpr float k_nan = std::numeric_limits<float>::quiet_NaN();

// What is known of one axis, per camera pixel: the Gray bits, and which of them are unsure.
struct AxisBits {
  cv::Mat code, unsure;  // CV_16U
  int bits = 0;
  int size = 0;

  AxisBits(int rows, int cols, int bit_count, int size_px)
      : code(rows, cols, CV_16U, cv::Scalar(0)),
        unsure(rows, cols, CV_16U, cv::Scalar(0)),
        bits(bit_count),
        size(size_px) {}
};

void take_bit(const cv::Mat& picture, const cv::Mat& inverse, const cv::Mat& step, int bit, AxisBits* axis) {
  const auto mask = static_cast<ushort>(1U << bit);
  for (int y = 0; y < picture.rows; ++y) {
    const uchar* a = picture.ptr<uchar>(y);
    const uchar* b = inverse.ptr<uchar>(y);
    const uchar* least = step.ptr<uchar>(y);
    ushort* code = axis->code.ptr<ushort>(y);
    ushort* unsure = axis->unsure.ptr<ushort>(y);
    for (int x = 0; x < picture.cols; ++x) {
      const int difference = a[x] - b[x];
      if (difference > 0) code[x] = static_cast<ushort>(code[x] | mask);
      if (std::abs(difference) < least[x]) unsure[x] = static_cast<ushort>(unsure[x] | mask);
    }
  }
}

unsigned binary_of_gray(unsigned gray) {
  for (unsigned shift = 1; shift < 16; shift *= 2) gray ^= gray >> shift;
  return gray;
}

struct Label {
  float centre = k_nan;
  float variance = k_nan;
};

// The label that sure bits give; without one when they do not settle it to 2^max_coarse neighbours.
Label label_of(unsigned code, unsigned unsure, const AxisBits& axis, int max_coarse) {
  int coarse = 0;
  while (coarse < axis.bits && (unsure >> coarse) & 1U) ++coarse;
  if (coarse > max_coarse) return {};
  const unsigned open = unsure >> coarse;
  const unsigned first = binary_of_gray(code >> coarse);
  unsigned other = first;
  if (open != 0) {
    if ((open & (open - 1)) != 0) return {};  // two unsure bits above sure ones
    other = binary_of_gray((code >> coarse) ^ open);
    if (std::max(first, other) - std::min(first, other) != 1) return {};
  }
  const double block = std::ldexp(1.0, coarse);
  const double low = std::min(first, other) * block, high = (std::max(first, other) + 1) * block;
  if (low >= axis.size) return {};  // a code that no projector pixel has
  const double end = std::min(high, static_cast<double>(axis.size)), width = end - low;
  return {static_cast<float>((low + end - 1) / 2), static_cast<float>(width * width / 12)};
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

// Levels by which a bit's two pictures must differ, per pixel; 255 where the pixel is unlit.
cv::Mat least_steps(const cv::Mat& white, const cv::Mat& black, const DecodeOptions& options, int* lit) {
  cv::Mat step(white.size(), CV_8U, cv::Scalar(255));
  for (int y = 0; y < white.rows; ++y) {
    for (int x = 0; x < white.cols; ++x) {
      const double contrast = white.at<uchar>(y, x) - black.at<uchar>(y, x);
      if (contrast < options.min_contrast) continue;
      ++*lit;
      step.at<uchar>(y, x) =
          static_cast<uchar>(std::ceil(std::max(options.min_step, options.min_share * contrast)));
    }
  }
  return step;
}

Status take_axis(const std::vector<std::filesystem::path>& pictures,
                 size_t first,
                 const cv::Mat& step,
                 AxisBits* axis) {
  for (int i = 0; i < axis->bits; ++i) {
    const size_t at = first + 2 * static_cast<size_t>(i);
    LIMN_TRY(const cv::Mat picture, read_shot(pictures[at], step.cols, step.rows));
    LIMN_TRY(const cv::Mat inverse, read_shot(pictures[at + 1], step.cols, step.rows));
    take_bit(picture, inverse, step, axis->bits - 1 - i, axis);
  }
  return {};
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
  Decoded decoded;
  cv::subtract(white, black, decoded.contrast);
  const cv::Mat step = least_steps(white, black, options, &decoded.lit);
  AxisBits columns(height, width, patterns.column_bits(), patterns.width);
  AxisBits rows(height, width, patterns.row_bits(), patterns.height);
  LIMN_TRY_STATUS(take_axis(pictures, 0, step, &columns));
  LIMN_TRY_STATUS(take_axis(pictures, 2 * static_cast<size_t>(columns.bits), step, &rows));

  decoded.px_projector = cv::Mat(height, width, CV_32FC2, cv::Scalar(k_nan, k_nan));
  decoded.variance = decoded.px_projector.clone();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (step.at<uchar>(y, x) == 255) continue;
      const Label u = label_of(columns.code.at<ushort>(y, x), columns.unsure.at<ushort>(y, x), columns,
                               options.max_coarse_bits);
      const Label v =
          label_of(rows.code.at<ushort>(y, x), rows.unsure.at<ushort>(y, x), rows, options.max_coarse_bits);
      if (std::isnan(u.centre) || std::isnan(v.centre)) continue;
      decoded.px_projector.at<cv::Vec2f>(y, x) = {u.centre, v.centre};
      decoded.variance.at<cv::Vec2f>(y, x) = {u.variance, v.variance};
      ++decoded.decoded;
    }
  }
  decoded.outliers = remove_outliers(&decoded.px_projector, options.max_from_median);
  decoded.decoded -= decoded.outliers;
  return decoded;
}

}  // namespace limn::calib
