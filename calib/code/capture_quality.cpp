#include "calib/code/capture_quality.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/median.h"

namespace limn::calib {
namespace {

using Eigen::Matrix4f;
using Eigen::Vector2f;
using Eigen::Vector4f;

// About the maximum; medians over them are accurate to a fraction of a level.
constexpr int k_samples = 20000;
constexpr int k_reduced_width = 320;    // width of the images that motion is measured in
constexpr int k_patch = 32;             // side of their patches
constexpr int k_steps = 5;              // Gauss-Newton steps; each halves the remaining error, or better
constexpr float k_least_texture = 4;    // levels per pixel, root mean square of a patch's weaker gradient
constexpr float k_max_patch_shift = 6;  // reduced pixels; larger steps have diverged
constexpr int k_saturated = 254;
constexpr double k_lit = 10;  // levels between bright and dark
// Times a sum's noise, the second limit: one dark sample in thousands exceeds it.
constexpr double k_lit_noise = 5;
constexpr double k_off = 0.25;       // share of the contrast
constexpr double k_off_noise = 4.5;  // times a sum's noise, the second limit
// Mean difference of two images of one pattern, as a share of the contrast.
constexpr double k_same = 0.08;
constexpr double k_odd_group = 0.05;   // share of samples that are off; motion at edges stays below
constexpr double k_wrong_group = 0.5;  // the same; motion never causes that much
// The same where images are displaced by some tenths of a pixel.
constexpr double k_odd_shaken = 0.3, k_wrong_shaken = 0.8;
// Contrast of an image's stripes: below the first, images of different patterns are as alike as k_same says;
// above the second, a camera that is not linear leaves sums right to k_off.
constexpr double k_resolved = 0.25, k_clear = 0.75;
constexpr double k_both_ways = 0.1;  // share of the samples whose sums are too dark, and too bright
// Light of an image without visible stripes, between black and white: a blurred pattern's. A camera with the
// sRGB curve shows half of the light at 0.73.
constexpr double k_grey_low = 0.2, k_grey_high = 0.85;

// The illuminated samples of a series: the sums of their images, and their largest difference.
struct Samples {
  std::vector<cv::Mat> images;  // CV_32F, one row each
  std::vector<float> sum, range;
  float noise = 0;  // standard deviation of a pair's sum, levels
  size_t size() const { return sum.size(); }
  const float* of(int image) const { return images[static_cast<size_t>(image)].ptr<float>(); }
};

bool is_pair(const PatternGroup& group) { return group.count == 2; }

// The sum of each sample's pairs, and the largest difference within a pair.
struct PairSums {
  std::vector<float> sum, range;
  // Standard deviation of one pair's sum, by the median over all samples, illuminated or not.
  float noise = 0;
};

// The scatter of sums about `middle`, times the level of their pair: flicker and blurred stripes of a camera
// that is not linear change a pair as a whole.
float noise_of(const std::vector<std::vector<float>>& sums, const std::vector<float>& middle) {
  std::vector<float> deviations;
  for (const std::vector<float>& pair : sums) {
    std::vector<float> levels;
    for (size_t at = 0; at < middle.size(); ++at) {
      if (middle[at] > k_lit) levels.push_back(pair[at] / middle[at]);
    }
    const float level = median(std::move(levels), 1.0F);
    for (size_t at = 0; at < middle.size(); ++at)
      deviations.push_back(std::abs(pair[at] - level * middle[at]));
  }
  return static_cast<float>(1.4826 * median(std::move(deviations)));
}

PairSums pair_sums(const std::vector<PatternGroup>& groups, const std::vector<cv::Mat>& all) {
  PairSums pairs;
  const auto samples = static_cast<size_t>(all[0].cols);
  pairs.range.assign(samples, 0);
  std::vector<std::vector<float>> sums;
  for (const PatternGroup& group : groups) {
    if (!is_pair(group)) continue;
    const uchar *a = all[static_cast<size_t>(group.first)].ptr<uchar>(),
                *b = all[static_cast<size_t>(group.first) + 1].ptr<uchar>();
    sums.emplace_back();
    for (size_t at = 0; at < samples; ++at) {
      sums.back().push_back(static_cast<float>(a[at] + b[at]));
      pairs.range[at] = std::max(pairs.range[at], static_cast<float>(std::abs(a[at] - b[at])));
    }
  }
  std::vector<float> own(sums.size());
  for (size_t at = 0; at < samples; ++at) {
    for (size_t i = 0; i < sums.size(); ++i) own[i] = sums[i][at];
    pairs.sum.push_back(median(own));
  }
  pairs.noise = noise_of(sums, pairs.sum);
  return pairs;
}

Samples lit_samples(const std::vector<PatternGroup>& groups, const std::vector<cv::Mat>& all) {
  const PairSums pairs = pair_sums(groups, all);
  const double least = std::max(k_lit, k_lit_noise * pairs.noise);
  Samples lit;
  lit.noise = pairs.noise;
  std::vector<int> places;
  for (size_t at = 0; at < pairs.sum.size(); ++at) {
    if (pairs.range[at] < least) continue;
    lit.sum.push_back(std::max(1.0F, pairs.sum[at]));
    lit.range.push_back(pairs.range[at]);
    places.push_back(static_cast<int>(at));
  }
  for (const cv::Mat& image : all) {
    cv::Mat row(1, static_cast<int>(places.size()), CV_32F);
    for (size_t i = 0; i < places.size(); ++i)
      row.at<float>(static_cast<int>(i)) = image.at<uchar>(places[i]);
    lit.images.push_back(row);
  }
  return lit;
}

GroupQuality quality_of(const Samples& lit, const PatternGroup& group) {
  GroupQuality quality{group.first, group.count};
  std::vector<float> levels;
  double contrast = 0, range = 0, off = 0;
  for (size_t i = 0; i < lit.size(); ++i) {
    float sum = 0, high = 0, low = 255;
    for (int k = 0; k < group.count; ++k) {
      const float value = lit.of(group.first + k)[i];
      sum += value;
      high = std::max(high, value);
      low = std::min(low, value);
    }
    sum *= 2 / static_cast<float>(group.count);
    levels.push_back(sum / lit.sum[i]);
    contrast += high - low;
    range += lit.range[i];
    off += std::abs(sum - lit.sum[i]) > std::max(k_off * lit.range[i], k_off_noise * lit.noise) ? 1 : 0;
  }
  quality.level = median(levels);
  quality.contrast = contrast / range;
  quality.off = off / static_cast<double>(lit.size());
  return quality;
}

// What an image shows of its stripes: its mean light between black (0) and white (1), and how much of the
// full contrast they have.
struct Stripes {
  double light = 0, contrast = 0;
  bool is_between() const { return light > k_grey_low && light < k_grey_high; }
  bool is_grey() const { return contrast < k_resolved && is_between(); }
};

Stripes stripes_of(const Samples& lit, int image) {
  double own = 0, sum = 0, range = 0, apart = 0;
  for (size_t i = 0; i < lit.size(); ++i) {
    own += lit.of(image)[i];
    sum += lit.sum[i];
    range += lit.range[i];
  }
  const auto mean = static_cast<float>(own / sum);
  for (size_t i = 0; i < lit.size(); ++i) apart += std::abs(lit.of(image)[i] - mean * lit.sum[i]);
  return {(own - (sum - range) / 2) / range, 2 * apart / range};
}

// Whether a pair is too dark at some samples and too bright at others. A camera that is not linear makes
// blurred stripes err one way.
bool errs_both_ways(const Samples& lit, int first) {
  size_t dark = 0, bright = 0;
  for (size_t i = 0; i < lit.size(); ++i) {
    const double error = lit.of(first)[i] + lit.of(first + 1)[i] - lit.sum[i];
    dark += error < -k_off * lit.range[i] ? 1 : 0;
    bright += error > k_off * lit.range[i] ? 1 : 0;
  }
  return static_cast<double>(std::min(dark, bright)) > k_both_ways * static_cast<double>(lit.size());
}

// Mean difference of two images over the samples, as a share of their range; `inverse`: uses the complement
// of the second image.
double difference(const Samples& lit, int a, int b, bool inverse) {
  double sum = 0, range = 0;
  for (size_t i = 0; i < lit.size(); ++i) {
    const float second = inverse ? lit.sum[i] - lit.of(b)[i] : lit.of(b)[i];
    sum += std::abs(lit.of(a)[i] - second);
    range += lit.range[i];
  }
  return sum / range;
}

// Explains why a pair does not add up, as far as the series shows; nullopt when no other image is like it.
std::optional<OddImage> finding(const Samples& lit,
                                const std::vector<PatternGroup>& groups,
                                const std::vector<std::filesystem::path>& files,
                                int first) {
  const auto name = [&](int i) { return files[static_cast<size_t>(i)].filename().string(); };
  for (const int image : {first, first + 1}) {
    const auto& file = files[static_cast<size_t>(image)];
    if (image > 0 && difference(lit, image, image - 1, false) < k_same)
      return OddImage{file, "shows the same as " + name(image - 1)};
    for (const PatternGroup& group : groups) {
      if (!is_pair(group) || group.first == first) continue;
      for (const int other : {group.first, group.first + 1}) {
        if (difference(lit, image, other, false) < k_same)
          return OddImage{file, "shows the same as " + name(other)};
      }
      // Images of two pairs have changed places; the sums do not show which two of the four.
      const bool crossed = difference(lit, first, group.first, true) < k_same ||
                           difference(lit, first, group.first + 1, true) < k_same;
      if (crossed)
        return OddImage{files[static_cast<size_t>(first)],
                        fmt::format("or {} has changed places with {} or {}", name(first + 1),
                                    name(group.first), name(group.first + 1))};
    }
  }
  return std::nullopt;
}

void find_odd(const Samples& lit,
              const std::vector<PatternGroup>& groups,
              const std::vector<std::filesystem::path>& files,
              CaptureQuality* quality) {
  // Where camera or board vibrates, the edges of ink and of fine stripes are off.
  const bool shakes = quality->shake.shakes;
  const double limit = shakes ? k_odd_shaken : k_odd_group, wrong = shakes ? k_wrong_shaken : k_wrong_group;
  for (const GroupQuality& group : quality->groups) {
    if (group.count != 2) continue;
    if (group.off < limit) continue;
    // Blur takes the contrast of the finest stripes. They all look alike then, and where a camera is not
    // linear they do not add up to white and black.
    const Stripes first = stripes_of(lit, group.first), second = stripes_of(lit, group.first + 1);
    if (first.is_grey() && second.is_grey()) continue;
    const bool is_clear = std::max(first.contrast, second.contrast) > k_clear || !first.is_between() ||
                          !second.is_between() || errs_both_ways(lit, group.first);
    if (auto odd = finding(lit, groups, files, group.first)) {
      quality->odd.push_back(std::move(*odd));
    } else if (group.off > wrong && is_clear) {
      const auto name = files[static_cast<size_t>(group.first) + 1].filename().string();
      quality->odd.push_back({files[static_cast<size_t>(group.first)],
                              "and " + name + " do not add up to what the other pairs do"});
    }
  }
}

// Shift of a patch in `b` relative to `a`: Gauss-Newton over shift, gain and offset.
struct PatchShift {
  bool textured = false;
  Vector2f shift = Vector2f::Zero();
};

PatchShift shift_of(const cv::Mat& a, const cv::Mat& b, const cv::Rect& patch) {
  PatchShift found;
  Vector2f at = Vector2f::Zero();
  float gain = 1, offset = 0;
  for (int step = 0; step < k_steps; ++step) {
    Matrix4f normal = Matrix4f::Zero();
    Vector4f right = Vector4f::Zero();
    int count = 0;
    for (int y = patch.y; y < patch.y + patch.height; ++y) {
      for (int x = patch.x; x < patch.x + patch.width; ++x) {
        const float u = static_cast<float>(x) + at.x(), v = static_cast<float>(y) + at.y();
        const int iu = static_cast<int>(std::floor(u)), iv = static_cast<int>(std::floor(v));
        if (iu < 0 || iv < 0 || iu + 1 >= b.cols || iv + 1 >= b.rows) continue;
        const float s = u - static_cast<float>(iu), t = v - static_cast<float>(iv);
        const float *p = b.ptr<float>(iv) + iu, *q = b.ptr<float>(iv + 1) + iu;
        const float top = p[0] + s * (p[1] - p[0]), low = q[0] + s * (q[1] - q[0]);
        const float value = top + t * (low - top);
        const Vector4f row(gain * ((1 - t) * (p[1] - p[0]) + t * (q[1] - q[0])), gain * (low - top), value,
                           1);
        normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
        right += (a.ptr<float>(y)[x] - gain * value - offset) * row;
        ++count;
      }
    }
    if (count < patch.area() / 2) return {};
    normal = normal.selfadjointView<Eigen::Lower>();
    const Eigen::Matrix2f gradients = normal.topLeftCorner<2, 2>() / static_cast<float>(count);
    const float weaker = gradients.selfadjointView<Eigen::Lower>().eigenvalues()[0];
    if (step == 0 && !(weaker > k_least_texture * k_least_texture)) return {};
    const Vector4f delta = normal.ldlt().solve(right);
    if (!delta.allFinite()) return {};
    at += delta.head<2>();
    gain += delta[2];
    offset += delta[3];
    if (at.norm() > k_max_patch_shift) break;
  }
  return {true, at};
}

void measure_motion(const cv::Mat& first, const cv::Mat& last, double scale, CaptureQuality* quality) {
  std::vector<float> lengths;
  for (int y = 0; y + k_patch <= first.rows; y += k_patch) {
    for (int x = 0; x + k_patch <= first.cols; x += k_patch) {
      const PatchShift patch = shift_of(last, first, {x, y, k_patch, k_patch});
      if (patch.textured) lengths.push_back(patch.shift.norm() * static_cast<float>(scale));
    }
  }
  quality->shift_patches = static_cast<int>(lengths.size());
  if (lengths.empty()) return;
  quality->shift_px = median(lengths);
  std::sort(lengths.begin(), lengths.end());
  quality->shift_worst_px = lengths[lengths.size() * 9 / 10];
}

// Mean of squares without the few residuals that motion or a flash has spoilt.
double trimmed_square(std::vector<float> residuals) {
  constexpr double k_trim = 4;  // standard deviations
  std::vector<float> sizes;
  for (const float r : residuals) sizes.push_back(std::abs(r));
  const double limit = k_trim * std::max(1.0, 1.4826 * median(sizes));
  double sum = 0;
  size_t count = 0;
  for (const float r : sizes) {
    if (r > limit) continue;
    sum += static_cast<double>(r) * r;
    ++count;
  }
  return sum / static_cast<double>(std::max<size_t>(1, count));
}

// Measures noise: an image and its inverse always have the same sum, so its scatter is the noise of two
// intensities. Noise variance is a straight line over the light, fitted to two halves of the samples, dim and
// bright.
void measure_noise(const Samples& lit, CaptureQuality* quality) {
  constexpr size_t k_least_sums = 2000;
  std::vector<float> sums = lit.sum;
  const auto middle = static_cast<float>(median(sums));
  std::array<std::vector<float>, 2> residuals;
  std::array<double, 2> light{}, count{};
  int pairs = 0;
  for (const GroupQuality& group : quality->groups) pairs += group.count == 2 && group.off < k_odd_group;
  if (pairs < 2) return;  // without inverses there are no equal sums
  for (const GroupQuality& group : quality->groups) {
    if (group.count != 2 || group.off >= k_odd_group) continue;
    const float *a = lit.of(group.first), *b = lit.of(group.first + 1);
    for (size_t i = 0; i < lit.size(); ++i) {
      if (std::max(a[i], b[i]) >= k_saturated || std::min(a[i], b[i]) < 1) continue;
      const size_t half = lit.sum[i] > middle ? 1 : 0;
      residuals[half].push_back((a[i] + b[i]) / static_cast<float>(group.level) - lit.sum[i]);
      light[half] += lit.sum[i];
      ++count[half];
    }
  }
  if (residuals[0].size() < k_least_sums || residuals[1].size() < k_least_sums) return;
  // The reference is the median of all sums; its variance is pi / 2 times that of a mean.
  const double own = 1 + std::numbers::pi / 2 / pairs - 2.0 / pairs;
  const double dim = trimmed_square(residuals[0]) / own, bright = trimmed_square(residuals[1]) / own;
  const double from = light[0] / count[0], to = light[1] / count[1];
  constexpr double k_rounding = 1.0 / 6;  // rounding of two intensities to whole levels
  constexpr double k_least_range = 1.3;   // ratio of the light in the halves; below, it is chance
  const double slope = to > k_least_range * from ? std::max(0.0, (bright - dim) / (to - from)) : 0;
  quality->noise.per_level = slope;
  quality->noise.read = std::max(k_rounding, slope > 0 ? dim - slope * from : (dim + bright) / 2) / 2;
}

void measure_waves(const Samples& lit, const Patterns& patterns, CaptureQuality* quality) {
  if (patterns.steps() == 0) return;
  const float *white = lit.of(patterns.white()), *black = lit.of(patterns.black());
  std::vector<float> light;
  for (size_t i = 0; i < lit.size(); ++i) {
    float sum = 0;
    for (int k = 0; k < 2 * patterns.steps(); ++k) sum += lit.of(patterns.first_step() + k)[i];
    const float mean = sum / static_cast<float>(2 * patterns.steps());
    if (white[i] - black[i] >= k_lit) light.push_back((mean - black[i]) / (white[i] - black[i]));
  }
  if (!light.empty()) quality->wave_level = median(light);
}

void measure_light(const Samples& lit, const Patterns& patterns, CaptureQuality* quality) {
  const float *white = lit.of(patterns.white()), *black = lit.of(patterns.black());
  quality->white_level = median(std::vector<float>(white, white + lit.size()));
  quality->black_level = median(std::vector<float>(black, black + lit.size()));
  const auto full = std::count_if(white, white + lit.size(), [](float v) { return v >= k_saturated; });
  quality->saturated = static_cast<double>(full) / static_cast<double>(lit.size());
}

bool holds(const GroupQuality& group,
           const std::vector<OddImage>& odd,
           const std::vector<std::filesystem::path>& files) {
  return std::any_of(odd.begin(), odd.end(), [&](const OddImage& image) {
    for (int k = 0; k < group.count; ++k) {
      if (files[static_cast<size_t>(group.first + k)] == image.file) return true;
    }
    return false;
  });
}

}  // namespace

CaptureQualityProbe::CaptureQualityProbe(const Patterns& patterns, int width, int height)
    : patterns_(patterns),
      width_(width),
      height_(height),
      stride_(std::max(1, static_cast<int>(std::sqrt(static_cast<double>(width) * height / k_samples)))),
      samples_(static_cast<size_t>(patterns.count())) {}

void CaptureQualityProbe::add_image(int index, const cv::Mat& image) {
  cv::Mat row(1, ((width_ + stride_ - 1) / stride_) * ((height_ + stride_ - 1) / stride_), CV_8U,
              cv::Scalar(0));
  int at = 0;
  for (int y = 0; y < height_; y += stride_) {
    // Every row begins at another column, so that upright stripes do not alias with the grid.
    for (int x = (y / stride_ * 3) % stride_; x < width_; x += stride_)
      row.ptr<uchar>()[at++] = image.ptr<uchar>(y)[x];
  }
  samples_[static_cast<size_t>(index)] = row.colRange(0, at);
  cv::Mat* sum = index <= 1 ? &first_ : index >= patterns_.white() ? &last_ : nullptr;
  if (!sum) return;
  const double scale = std::min(1.0, static_cast<double>(k_reduced_width) / width_);
  cv::Mat reduced;
  cv::resize(image, reduced, {}, scale, scale, cv::INTER_AREA);
  if (sum->empty()) *sum = cv::Mat(reduced.size(), CV_32F, cv::Scalar(0));
  cv::add(*sum, reduced, *sum, cv::noArray(), CV_32F);
}

CaptureQuality CaptureQualityProbe::quality(const std::vector<std::filesystem::path>& files,
                                            const Shake& shake) const {
  CaptureQuality quality;
  quality.shake = shake;
  const std::vector<PatternGroup> groups = patterns_.groups();
  const Samples lit = lit_samples(groups, samples_);
  quality.samples = static_cast<int>(lit.size());
  if (lit.size() == 0) return quality;
  measure_light(lit, patterns_, &quality);
  quality.widest_stripe_px = patterns_.widest_stripe_px();
  for (const PatternGroup& group : groups) quality.groups.push_back(quality_of(lit, group));
  find_odd(lit, groups, files, &quality);
  for (const GroupQuality& group : quality.groups) {
    if (group.count != 2 || holds(group, quality.odd, files)) continue;
    quality.level_low = std::min(quality.level_low, group.level);
    quality.level_high = std::max(quality.level_high, group.level);
  }
  measure_noise(lit, &quality);
  measure_waves(lit, patterns_, &quality);
  measure_motion(first_, last_, static_cast<double>(width_) / first_.cols, &quality);
  return quality;
}

}  // namespace limn::calib
