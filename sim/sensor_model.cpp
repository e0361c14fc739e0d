#include "sim/sensor_model.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <mutex>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace limn::sim {
namespace {

constexpr double k_blur_step_px = 0.25;  // the defocus blur is rounded to multiples of this standard
                                         // deviation; edge spreads differ by < 1 %
constexpr int k_blur_levels = 40;        // up to 10 px, more than is ever needed

// The light of one projector, prepared for lookups: in one channel for a grey camera, else in blue, green and
// red.
template <int k_channels>
class Beam {
 public:
  using Light = Eigen::Array<float, k_channels, 1>;

  Beam(const Imager& projector, const ProjectorEffects& effects, const cv::Mat& shown)
      : width_(static_cast<float>(projector.width)),
        height_(static_cast<float>(projector.height)),
        effects_(effects),
        dark_(shown.empty()) {
    black_ = static_cast<float>(effects.illuminance_at_1m * effects.black_level);
    vignetting_ = static_cast<float>(effects.vignetting) * 4 / (width_ * width_ + height_ * height_);
    blur_levels_m_ = static_cast<float>(projector.lens.fx() * effects.aperture_m / 4 / k_blur_step_px);
    blur_at_focus_ = blur_levels_m_ / static_cast<float>(effects.focus_m);
    if (!dark_) sharp_ = light_of(shown);
  }

  /// Computes the blurred images that these samples need, where they need them. To be called before at().
  void prepare(std::span<const ProjectorView> views) {
    if (dark_) return;
    columns_ = (sharp_.cols + k_block - 1) / k_block;
    rows_ = (sharp_.rows + k_block - 1) / k_block;
    const std::vector<std::uint8_t> plain = plain_blocks();
    const Blocks used = used_blocks(views);
    std::vector<std::pair<int, cv::Rect>> work;
    levels_[0] = sharp_;
    for (int level = 1; level < k_blur_levels; ++level) {
      const std::vector<std::uint8_t>& of_level = used[static_cast<std::size_t>(level)];
      if (of_level.empty()) continue;
      cv::Mat& blurred = levels_[static_cast<std::size_t>(level)];
      blurred.create(sharp_.size(), sharp_.type());
      for (std::size_t i = 0; i < of_level.size(); ++i) {
        if (of_level[i] == 0) continue;
        const cv::Rect block = pixels(i);
        if (plain[i] != 0 && half_side(level) <= k_block)
          sharp_(block).copyTo(blurred(block));  // a blur changes nothing
        else
          work.emplace_back(level, block);
      }
    }
    cv::parallel_for_({0, static_cast<int>(work.size())}, [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i) {
        const auto& [level, block] = work[static_cast<std::size_t>(i)];
        const double sigma = level * k_blur_step_px;
        const int side = 2 * half_side(level) + 1;
        cv::Mat blurred = levels_[static_cast<std::size_t>(level)](block);
        cv::GaussianBlur(sharp_(block), blurred, {side, side}, sigma, sigma, cv::BORDER_REPLICATE);
      }
    });
  }

  Light at(const ProjectorView& view) const {
    const float gain = view.gain * vignette(view);
    if (dark_) return Light::Constant(gain * (black_ * coverage(view)));
    return gain * lookup(view);
  }

 private:
  static constexpr int k_pad = 24;    // black pixels around the panel, into which the blur can spread
  static constexpr int k_block = 48;  // side of the blocks that are blurred or not, px
  // For each level, whether each block is used; empty: none is.
  using Blocks = std::array<std::vector<std::uint8_t>, k_blur_levels>;

  static int half_side(int level) { return static_cast<int>(std::ceil(3.5 * level * k_blur_step_px)); }

  cv::Rect pixels(std::size_t block) const {
    const auto i = static_cast<int>(block);
    return cv::Rect(i % columns_ * k_block, i / columns_ * k_block, k_block, k_block) &
           cv::Rect({0, 0}, sharp_.size());
  }

  // The blocks that have one value together with all blocks around them.
  std::vector<std::uint8_t> plain_blocks() const {
    std::vector<std::uint8_t> alone(static_cast<std::size_t>(columns_ * rows_)), plain(alone.size());
    cv::parallel_for_({0, rows_}, [&](const cv::Range& range) {
      for (int i = range.start * columns_; i < range.end * columns_; ++i)
        alone[static_cast<std::size_t>(i)] = is_plain(sharp_(pixels(static_cast<std::size_t>(i)))) ? 1 : 0;
    });
    const auto first = [&](int block) {
      return sharp_.ptr(block / columns_ * k_block, block % columns_ * k_block);
    };
    for (int row = 0; row < rows_; ++row)
      for (int column = 0; column < columns_; ++column) {
        bool is = true;
        for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r)
          for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c)
            is = is && alone[static_cast<std::size_t>(r * columns_ + c)] != 0 &&
                 std::memcmp(first(r * columns_ + c), first(row * columns_ + column), sharp_.elemSize()) == 0;
        plain[static_cast<std::size_t>(row * columns_ + column)] = is ? 1 : 0;
      }
    return plain;
  }

  static bool is_plain(const cv::Mat& image) {
    const float* first = image.ptr<float>();
    const std::size_t row_bytes = static_cast<std::size_t>(image.cols) * image.elemSize();
    for (int column = 1; column < image.cols; ++column)
      if (std::memcmp(first + column * k_channels, first, image.elemSize()) != 0) return false;
    for (int row = 1; row < image.rows; ++row)
      if (std::memcmp(image.ptr(row), first, row_bytes) != 0) return false;
    return true;
  }

  Blocks used_blocks(std::span<const ProjectorView> views) const {
    constexpr std::size_t k_chunk = 65536;
    const auto chunks = static_cast<int>((views.size() + k_chunk - 1) / k_chunk);
    Blocks used;
    std::mutex mutex;
    cv::parallel_for_({0, chunks}, [&](const cv::Range& range) {
      Blocks here;
      const std::size_t end = std::min(views.size(), static_cast<std::size_t>(range.end) * k_chunk);
      for (std::size_t i = static_cast<std::size_t>(range.start) * k_chunk; i < end; ++i)
        if (views[i].gain > 0) mark(views[i], &here);
      const std::lock_guard lock(mutex);
      for (std::size_t level = 0; level < used.size(); ++level) {
        if (here[level].empty()) continue;
        used[level].resize(here[level].size());
        std::transform(here[level].begin(), here[level].end(), used[level].begin(), used[level].begin(),
                       std::bit_or<>());
      }
    });
    return used;
  }

  // Marks the blocks that a lookup reads: its pixel and the next ones to the right and below.
  void mark(const ProjectorView& view, Blocks* used) const {
    const std::size_t level = level_of(view.depth);
    if (level == 0) return;
    std::vector<std::uint8_t>& blocks = (*used)[level];
    if (blocks.empty()) blocks.resize(static_cast<std::size_t>(columns_ * rows_));
    const int c = static_cast<int>(view.u + k_pad), r = static_cast<int>(view.v + k_pad);
    const int left = c / k_block, right = (c + 1) / k_block, top = r / k_block, bottom = (r + 1) / k_block;
    blocks[static_cast<std::size_t>(top * columns_ + left)] = 1;
    if (left == right && top == bottom) return;
    blocks[static_cast<std::size_t>(top * columns_ + right)] = 1;
    blocks[static_cast<std::size_t>(bottom * columns_ + left)] = 1;
    blocks[static_cast<std::size_t>(bottom * columns_ + right)] = 1;
  }

  // Light of all display values, CV_32F or CV_32FC3 (BGR), with as many channels as the image.
  cv::Mat light_of_values(int channels) const {
    cv::Mat light(1, 256, CV_32FC(channels));
    for (int v = 0; v < 256; ++v)
      for (int c = 0; c < channels; ++c)
        light.ptr<float>()[v * channels + c] =
            static_cast<float>(effects_.illuminance_at_1m * light_share(effects_, c, v / 255.0));
    return light;
  }

  cv::Mat light_of(const cv::Mat& shown) const {
    const cv::Rect inner(k_pad, k_pad, shown.cols, shown.rows);
    cv::Mat light = cv::Mat::zeros(shown.rows + 2 * k_pad, shown.cols + 2 * k_pad, CV_32FC(k_channels));
    cv::Mat linear = shown;
    if (shown.depth() == CV_32F) {
      in_channels(shown * effects_.illuminance_at_1m).copyTo(light(inner));
      return light;
    }
    if (shown.channels() == 1 && effects_.channel_gamma != Eigen::Vector3d::Ones())
      cv::cvtColor(shown, linear, cv::COLOR_GRAY2BGR);
    cv::Mat into = light(inner);  // without a copy where the channels are already right
    if (linear.channels() == k_channels) {
      cv::LUT(linear, light_of_values(k_channels), into);
    } else {
      cv::LUT(linear, light_of_values(linear.channels()), linear);
      in_channels(linear).copyTo(into);
    }
    return light;
  }

  static cv::Mat in_channels(cv::Mat light) {
    if (light.channels() == 3 && k_channels == 1)
      cv::transform(light, light, cv::Matx13f(0.0722F, 0.7152F, 0.2126F));  // BT.709 luminance of BGR
    else if (light.channels() == 1 && k_channels == 3)
      cv::cvtColor(light, light, cv::COLOR_GRAY2BGR);
    return light;
  }

  // A disc of diameter D has a standard deviation of D / 4; D = aperture |depth - focus| / focus on the
  // surface.
  std::size_t level_of(float depth) const {
    const float level = std::abs(blur_at_focus_ - blur_levels_m_ / depth) + 0.5F;
    return std::min<std::size_t>(static_cast<std::size_t>(level), k_blur_levels - 1);
  }

  // Bilinear lookup: it averages the projector's square pixels over a camera pixel of similar size.
  Light lookup(const ProjectorView& view) const {
    const cv::Mat& light = levels_[level_of(view.depth)];
    const float x = view.u + k_pad, y = view.v + k_pad;
    const int c = static_cast<int>(x), r = static_cast<int>(y);
    const float fx = x - static_cast<float>(c), fy = y - static_cast<float>(r);
    const Eigen::Map<const Light> upper_left(light.ptr<float>(r) + k_channels * c),
        upper_right(light.ptr<float>(r) + k_channels * (c + 1)),
        lower_left(light.ptr<float>(r + 1) + k_channels * c),
        lower_right(light.ptr<float>(r + 1) + k_channels * (c + 1));
    return (1 - fy) * (upper_left + fx * (upper_right - upper_left)) +
           fy * (lower_left + fx * (lower_right - lower_left));
  }

  float coverage(const ProjectorView& view) const {
    return std::clamp(std::min(view.u + 1, width_ - view.u), 0.0F, 1.0F) *
           std::clamp(std::min(view.v + 1, height_ - view.v), 0.0F, 1.0F);
  }

  float vignette(const ProjectorView& view) const {
    const float dx = view.u - (width_ - 1) / 2, dy = view.v - (height_ - 1) / 2;
    return 1 - vignetting_ * (dx * dx + dy * dy);
  }

  float width_, height_;
  ProjectorEffects effects_;
  bool dark_;
  float black_ = 0;
  float vignetting_ = 0;                         // for each squared pixel of distance from the panel's middle
  float blur_levels_m_ = 0, blur_at_focus_ = 0;  // blur level = |blur_at_focus - blur_levels_m / depth|
  int columns_ = 0, rows_ = 0;                   // number of blocks
  cv::Mat sharp_;
  std::array<cv::Mat, k_blur_levels> levels_;  // valid in the blocks that prepare() was told of
};

template <int k_channels>
std::vector<Beam<k_channels>> beams_of(const World& world,
                                       const Samples& samples,
                                       std::span<const cv::Mat> shown) {
  std::vector<Beam<k_channels>> beams;
  for (std::size_t k = 0; k < samples.projectors.size(); ++k) {
    const Imager& projector = world.rig.projectors.at(k);
    const cv::Mat image = shown.empty() ? cv::Mat() : shown[k];
    if (!image.empty()) {
      LIMN_CHECK(image.cols == projector.width && image.rows == projector.height);
      LIMN_CHECK(image.type() == CV_8UC1 || image.type() == CV_8UC3 || image.type() == CV_32FC3);
    }
    beams.emplace_back(projector, world.projector_effects.at(k), image);
    beams.back().prepare(samples.projectors[k]);
  }
  return beams;
}

// The factor for the gain of a view if falloff or incidence is switched off.
float unphysical_gain(const World& world, const Samples& samples, std::size_t projector, std::size_t i) {
  const ProjectorEffects& effects = world.projector_effects[projector];
  if (effects.falloff && effects.incidence) return 1;
  const Eigen::Vector3d p = world.rig.projectors[projector].imager_from_world.inverse().translation;
  const Eigen::Vector3f towards = p.cast<float>() - samples.p_world[i];
  const float cosine = samples.n_world[i].dot(towards.normalized());
  return (effects.falloff ? 1 : towards.squaredNorm()) / (effects.incidence ? 1 : std::max(cosine, 1e-3F));
}

// The light that the camera's pixels receive, CV_32F with these channels.
template <int k_channels>
cv::Mat light_in(const World& world, const Samples& samples, std::span<const cv::Mat> shown) {
  using Light = typename Beam<k_channels>::Light;
  const std::vector<Beam<k_channels>> beams = beams_of<k_channels>(world, samples, shown);
  cv::Mat light(samples.height, samples.width, CV_32FC(k_channels));
  auto* out = light.ptr<float>();
  const std::size_t pixels = light.total(), extra = samples.size() - pixels;
  std::vector<float> more(k_channels * extra);
  const bool physical = std::all_of(world.projector_effects.begin(), world.projector_effects.end(),
                                    [](const ProjectorEffects& e) { return e.falloff && e.incidence; });
  const auto reflected = [&](std::size_t i) -> Light {
    if constexpr (k_channels == 1)
      return Light::Constant(samples.grey[i]);
    else
      return samples.weight[i] * samples.albedo[i].array();
  };
  constexpr std::size_t k_chunk = 16384;
  const auto chunks = static_cast<int>((samples.size() + k_chunk - 1) / k_chunk);
  cv::parallel_for_({0, chunks}, [&](const cv::Range& range) {
    const std::size_t end = std::min(samples.size(), static_cast<std::size_t>(range.end) * k_chunk);
    for (std::size_t i = static_cast<std::size_t>(range.start) * k_chunk; i < end; ++i) {
      Light illuminance = Light::Constant(samples.room_light[i]);
      for (std::size_t k = 0; k < beams.size(); ++k) {
        const ProjectorView& view = samples.projectors[k][i];
        if (view.gain <= 0) continue;
        illuminance += beams[k].at(view) * (physical ? 1 : unphysical_gain(world, samples, k, i));
      }
      float* at = i < pixels ? out + k_channels * i : more.data() + k_channels * (i - pixels);
      Eigen::Map<Light> received(at);
      received = reflected(i) * illuminance;
    }
  });
  for (std::size_t i = 0; i < extra; ++i)
    for (std::size_t c = 0; c < k_channels; ++c)
      out[k_channels * static_cast<std::size_t>(samples.pixel[pixels + i]) + c] += more[k_channels * i + c];
  return light;
}

// Weights of a Gaussian blur that also displaces; without blur, of linear interpolation.
cv::Mat shifted_kernel(double sigma, double shift) {
  const int half = static_cast<int>(std::ceil(4 * sigma + std::abs(shift)));
  cv::Mat kernel(2 * half + 1, 1, CV_32F);
  for (int i = -half; i <= half; ++i) {
    const double d = i - shift;
    kernel.at<float>(i + half) = static_cast<float>(sigma > 0 ? std::exp(-d * d / (2 * sigma * sigma))
                                                              : std::max(0.0, 1 - std::abs(d)));
  }
  // Filters of OpenCV correlate: the kernel is turned round.
  cv::flip(kernel, kernel, 0);
  return kernel / cv::sum(kernel)[0];
}

// Applies exposure and vignetting, which is quadratic in the distance from the image's middle.
void expose_row(const CameraEffects& effects, double gain, cv::Mat& signal, int r) {
  const auto width = static_cast<float>(signal.cols), height = static_cast<float>(signal.rows);
  const auto exposure = static_cast<float>(gain * effects.exposure);
  const float loss = static_cast<float>(effects.vignetting) * 4 / (width * width + height * height);
  const float dy = static_cast<float>(r) - (height - 1) / 2;
  auto* value = signal.ptr<float>(r);
  for (int c = 0; c < signal.cols; ++c) {
    const float dx = static_cast<float>(c) - (width - 1) / 2;
    const float gain = exposure * (1 - loss * (dx * dx + dy * dy));
    for (int k = 0; k < signal.channels(); ++k) *value++ *= gain;
  }
}

void in_row_strips(int rows, const std::function<void(const cv::Range&)>& work) {
  constexpr int k_strips = 8;
  cv::parallel_for_({0, k_strips}, [&](const cv::Range& range) {
    work({rows * range.start / k_strips, rows * range.end / k_strips});
  });
}

// 65536 quantiles of the normal distribution, computed by Newton's method. A 16-bit random number picks one.
const std::vector<float>& normal_quantiles() {
  static const std::vector<float> table = [] {
    std::vector<float> t(65536);
    double x = -4.3;
    for (std::size_t i = 0; i < t.size() / 2; ++i) {
      const double p = (static_cast<double>(i) + 0.5) / static_cast<double>(t.size());
      for (int step = 0; step < 8; ++step)
        x -= (0.5 * std::erfc(-x / std::sqrt(2.0)) - p) /
             (std::exp(-x * x / 2) / std::sqrt(2 * std::numbers::pi));
      t[i] = static_cast<float>(x);
      t[t.size() - 1 - i] = static_cast<float>(-x);
    }
    return t;
  }();
  return table;
}

// Sebastiano Vigna's splitmix64: gives a different, well mixed number for every input.
std::uint64_t mixed(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15U;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31U);
}

// 8-bit level (before rounding) of the sRGB curve, for linear signal 0..1 in 65536 steps.
const std::vector<float>& srgb_from_linear() {
  static const std::vector<float> table = [] {
    std::vector<float> t(65536);
    for (std::size_t i = 0; i < t.size(); ++i) {
      const double v = static_cast<double>(i) / static_cast<double>(t.size() - 1);
      t[i] = static_cast<float>(v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055);
    }
    return t;
  }();
  return table;
}

float encoded(const CameraEffects& effects, float signal) {
  if (!effects.srgb) return signal;
  if (signal <= 0) return 12.92F * signal;
  return srgb_from_linear()[static_cast<std::size_t>(std::min(signal, 1.0F) * 65535.0F + 0.5F)];
}

void digitise_row(
    const CameraEffects& effects, const float* signal, std::uint8_t* levels, int count, std::uint64_t seed) {
  const std::vector<float>& normal = normal_quantiles();
  const bool noisy = effects.full_well_e > 0 || effects.read_noise > 0;
  const float shot = effects.full_well_e > 0 ? static_cast<float>(1 / effects.full_well_e) : 0;
  const auto read = static_cast<float>(effects.read_noise / 255);
  const auto black = static_cast<float>(effects.black_level);
  std::uint64_t bits = 0;
  for (int i = 0; i < count; ++i) {
    float value = signal[i];
    if (noisy) {
      bits = (i & 3) == 0 ? mixed(seed + static_cast<std::uint64_t>(i)) : bits >> 16U;
      value += std::sqrt(read * read + shot * std::max(value, 0.0F)) * normal[bits & 0xffffU];
    }
    levels[i] = cv::saturate_cast<std::uint8_t>(black + (255 - black) * encoded(effects, value));
  }
}

// Applies the overlap of the camera's colour filters.
void mix(const CameraEffects& effects, cv::Mat* light) {
  if (effects.sensitivity == Eigen::Matrix3d::Identity()) return;
  cv::Matx33f matrix;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) matrix(r, c) = static_cast<float>(effects.sensitivity(r, c));
  cv::transform(*light, *light, matrix);
}

}  // namespace

double light_share(const ProjectorEffects& effects, int channel, double value) {
  const double power = std::pow(value, effects.gamma * effects.channel_gamma[channel]);
  const double smoothstep = value * value * (3 - 2 * value);
  const double share = (1 - effects.s_curve) * power + effects.s_curve * smoothstep;
  return effects.black_level + (1 - effects.black_level) * share;
}

cv::Mat ideal_light(const World& world, const Samples& samples, std::span<const cv::Mat> shown) {
  LIMN_CHECK(shown.empty() || shown.size() == samples.projectors.size());
  if (!world.camera_effects.at(static_cast<std::size_t>(samples.camera)).colour)
    return light_in<1>(world, samples, shown);
  cv::Mat light = light_in<3>(world, samples, shown);
  mix(world.camera_effects[static_cast<std::size_t>(samples.camera)], &light);
  return light;
}

Disturbance disturbance(const World& world, int camera, std::uint64_t seed) {
  const CameraEffects& effects = world.camera_effects.at(static_cast<std::size_t>(camera));
  constexpr std::uint64_t k_stream = 0x5851f42d4c957f2dU;  // tells these numbers from those of the noise
  std::mt19937_64 rng(mixed(mixed(seed ^ k_stream) + static_cast<std::uint64_t>(camera)));
  std::normal_distribution<double> normal(0, 1);
  Disturbance drawn;
  drawn.shift_px.x() = effects.shake_px * normal(rng);
  drawn.shift_px.y() = effects.shake_px * normal(rng);
  drawn.gain = std::max(0.0, 1 + effects.flicker * normal(rng));
  return drawn;
}

cv::Mat exposed(const World& world, int camera, const cv::Mat& light, const Disturbance& disturbance) {
  const CameraEffects& effects = world.camera_effects.at(static_cast<std::size_t>(camera));
  cv::Mat signal(light.size(), light.type());
  const int side = 2 * static_cast<int>(std::ceil(4 * effects.psf_px)) + 1;
  in_row_strips(light.rows, [&](const cv::Range& rows) {
    cv::Mat strip = signal.rowRange(rows);  // the filter also reads rows outside its strip
    if (!disturbance.shift_px.isZero(0))
      cv::sepFilter2D(
          light.rowRange(rows), strip, -1, shifted_kernel(effects.psf_px, disturbance.shift_px.x()),
          shifted_kernel(effects.psf_px, disturbance.shift_px.y()), {-1, -1}, 0, cv::BORDER_REPLICATE);
    else if (effects.psf_px > 0)
      cv::GaussianBlur(light.rowRange(rows), strip, {side, side}, effects.psf_px, effects.psf_px,
                       cv::BORDER_REPLICATE);
    else
      light.rowRange(rows).copyTo(strip);
    for (int r = rows.start; r < rows.end; ++r) expose_row(effects, disturbance.gain, signal, r);
  });
  return signal;
}

cv::Mat digitised(const World& world, int camera, const cv::Mat& signal, std::uint64_t seed) {
  const CameraEffects& effects = world.camera_effects.at(static_cast<std::size_t>(camera));
  cv::Mat levels(signal.size(), CV_MAKETYPE(CV_8U, signal.channels()));
  const std::uint64_t stream = mixed(seed ^ mixed(static_cast<std::uint64_t>(camera) + 1));
  in_row_strips(signal.rows, [&](const cv::Range& rows) {
    for (int r = rows.start; r < rows.end; ++r)
      digitise_row(effects, signal.ptr<float>(r), levels.ptr(r), signal.cols * signal.channels(),
                   mixed(stream + static_cast<std::uint64_t>(r)));
  });
  return levels;
}

cv::Mat photograph(const World& world,
                   const Samples& samples,
                   std::span<const cv::Mat> shown,
                   std::uint64_t seed) {
  const cv::Mat light = ideal_light(world, samples, shown);
  const Disturbance disturbed = disturbance(world, samples.camera, seed);
  return digitised(world, samples.camera, exposed(world, samples.camera, light, disturbed), seed);
}

}  // namespace limn::sim
