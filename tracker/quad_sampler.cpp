#include "tracker/quad_sampler.h"

#include <algorithm>
#include <cmath>

#include "core/result.h"
#include "tracker/simd.h"
#include "tracker/square_to_quad.h"

namespace limn::tracker {
namespace {

using View = QuadSampler::View;

// The comparisons are written so that NaN also gives a pixel.
inline void find_place(const View& view, float u, float v, float* x, float* y) {
  const auto& h = view.homography;
  const float scale = 1 / (h[6] * u + h[7] * v + 1);
  const float to_x = (h[0] * u + h[1] * v + h[2]) * scale;
  const float to_y = (h[3] * u + h[4] * v + h[5]) * scale;
  const float right_x = to_x > 0 ? to_x : 0;
  const float right_y = to_y > 0 ? to_y : 0;
  *x = right_x < view.high_x ? right_x : view.high_x;
  *y = right_y < view.high_y ? right_y : view.high_y;
}

LIMN_SIMD void find_nearest(const View& view,
                            const float* __restrict u,
                            const float* __restrict v,
                            std::size_t count,
                            std::int32_t* __restrict offsets) {
  for (std::size_t i = 0; i < count; ++i) {
    float x = 0, y = 0;
    find_place(view, u[i], v[i], &x, &y);
    offsets[i] = static_cast<std::int32_t>(y + 0.5F) * view.stride + static_cast<std::int32_t>(x + 0.5F);
  }
}

LIMN_SIMD void find_between(const View& view,
                            const float* __restrict u,
                            const float* __restrict v,
                            std::size_t count,
                            std::int32_t* __restrict offsets,
                            float* __restrict across,
                            float* __restrict down) {
  for (std::size_t i = 0; i < count; ++i) {
    float x = 0, y = 0;
    find_place(view, u[i], v[i], &x, &y);
    const auto whole_x = static_cast<std::int32_t>(x), whole_y = static_cast<std::int32_t>(y);
    const std::int32_t column = whole_x < view.last_x ? whole_x : view.last_x;
    const std::int32_t row = whole_y < view.last_y ? whole_y : view.last_y;
    across[i] = x - static_cast<float>(column);
    down[i] = y - static_cast<float>(row);
    offsets[i] = row * view.stride + column;
  }
}

struct Neighbours {
  std::array<float, QuadSampler::k_most> here, right, below, beyond;
};

LIMN_SIMD void interpolate(const Neighbours& levels,
                           const float* __restrict across,
                           const float* __restrict down,
                           std::size_t count,
                           float* __restrict into) {
  for (std::size_t i = 0; i < count; ++i) {
    const float upper = levels.here[i] + across[i] * (levels.right[i] - levels.here[i]);
    const float lower = levels.below[i] + across[i] * (levels.beyond[i] - levels.below[i]);
    into[i] = upper + down[i] * (lower - upper);
  }
}

}  // namespace

QuadSampler::QuadSampler(const cv::Mat& grey,
                         const std::array<Eigen::Vector2d, 4>& corners_px,
                         double beyond) {
  const int last_x = std::max(0, grey.cols - 2), last_y = std::max(0, grey.rows - 2);
  const auto [left, right] =
      std::minmax({corners_px[0].x(), corners_px[1].x(), corners_px[2].x(), corners_px[3].x()});
  const auto [top, bottom] =
      std::minmax({corners_px[0].y(), corners_px[1].y(), corners_px[2].y(), corners_px[3].y()});
  const auto first = [](double lowest, int last) {
    return lowest > 0 ? static_cast<int>(std::min(lowest, static_cast<double>(last))) : 0;
  };
  // Perspective may show what lies outside larger than the square itself.
  const double around = 2 * beyond * std::max(right - left, bottom - top);
  const int x0 = first(left - around, last_x), y0 = first(top - around, last_y);
  std::array<Eigen::Vector2d, 4> corners = corners_px;
  for (Eigen::Vector2d& corner : corners) corner -= Eigen::Vector2d(x0, y0);
  const Eigen::Matrix3d m = SquareToQuad(corners).matrix();
  for (int i = 0; i < 8; ++i)
    view_.homography[static_cast<std::size_t>(i)] = static_cast<float>(m(i / 3, i % 3));
  view_.high_x = static_cast<float>(grey.cols - 1 - x0);
  view_.high_y = static_cast<float>(grey.rows - 1 - y0);
  view_.last_x = last_x - x0;
  view_.last_y = last_y - y0;
  view_.stride = static_cast<std::int32_t>(grey.step[0]);
  origin_ = grey.ptr(y0) + x0;
  right_ = grey.cols > 1 ? 1 : 0;
  below_ = grey.rows > 1 ? view_.stride : 0;
}

void QuadSampler::nearest(std::span<const float> x, std::span<const float> y, std::uint8_t* levels) const {
  LIMN_CHECK(x.size() == y.size() && x.size() <= k_most);
  std::array<std::int32_t, k_most> offsets;
  find_nearest(view_, x.data(), y.data(), x.size(), offsets.data());
  for (std::size_t i = 0; i < x.size(); ++i) levels[i] = origin_[offsets[i]];
}

void QuadSampler::between(std::span<const float> x, std::span<const float> y, float* levels) const {
  LIMN_CHECK(x.size() == y.size() && x.size() <= k_most);
  std::array<std::int32_t, k_most> offsets;
  std::array<float, k_most> across, down;
  Neighbours neighbours;
  find_between(view_, x.data(), y.data(), x.size(), offsets.data(), across.data(), down.data());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const std::uint8_t* pixel = origin_ + offsets[i];
    neighbours.here[i] = pixel[0];
    neighbours.right[i] = pixel[right_];
    neighbours.below[i] = pixel[below_];
    neighbours.beyond[i] = pixel[below_ + right_];
  }
  interpolate(neighbours, across.data(), down.data(), x.size(), levels);
}

}  // namespace limn::tracker
