#include "tracker/pattern_normal_sums.h"

#include <cmath>

#include "tracker/simd.h"

namespace limn::tracker::pattern {

LIMN_SIMD void scale_by(const float* __restrict factors, std::size_t count, float* __restrict values) {
  for (std::size_t i = 0; i < count; ++i) values[i] *= factors[i];
}

LIMN_SIMD void compare(const float* __restrict light,
                       std::size_t count,
                       float* __restrict expected,
                       float* __restrict sizes) {
  for (std::size_t i = 0; i < count; ++i) {
    expected[i] = light[i] - expected[i];
    sizes[i] = std::abs(expected[i]);
  }
}

LIMN_SIMD void find_places(const float* __restrict x,
                           const float* __restrict y,
                           std::size_t count,
                           const float* __restrict square_from_px,
                           const float* __restrict reach,
                           float* __restrict level_x,
                           float* __restrict level_y,
                           std::int32_t* __restrict keeps) {
  const float* h = square_from_px;
  for (std::size_t i = 0; i < count; ++i) {
    const float scale = 1 / (h[6] * x[i] + h[7] * y[i] + h[8]);
    const float u = (h[0] * x[i] + h[1] * y[i] + h[2]) * scale;
    const float v = (h[3] * x[i] + h[4] * y[i] + h[5]) * scale;
    const int beside_x = (u < 0) | (u > 1);
    const int beside_y = (v < 0) | (v > 1);
    const int near = (v > -reach[0]) & (u < 1 + reach[1]) & (v < 1 + reach[2]) & (u > -reach[3]);
    level_x[i] = 2 * u - 1;
    level_y[i] = 2 * v - 1;
    keeps[i] = near & ~(beside_x & beside_y);
  }
}

LIMN_SIMD float median(const float* __restrict values, std::size_t count) {
  std::uint32_t found = 0;
  for (int bit = 30; bit >= 0; --bit) {
    const std::uint32_t bound = found | 1U << bit;
    std::uint32_t below = 0;
#pragma omp simd reduction(+ : below)
    for (std::size_t i = 0; i < count; ++i) below += __builtin_bit_cast(std::uint32_t, values[i]) < bound;
    if (below <= count / 2) found = bound;
  }
  return __builtin_bit_cast(float, found);
}

LIMN_SIMD Unlike sum_behind(const float* __restrict residuals,
                            const float* __restrict behind,
                            std::size_t count) {
  float squares = 0, weights = 1e-9F;
#pragma omp simd reduction(+ : squares, weights)
  for (std::size_t i = 0; i < count; ++i) {
    squares += behind[i] * residuals[i] * residuals[i];
    weights += behind[i];
  }
  return {squares, weights};
}

LIMN_SIMD Weights weigh(const float* __restrict residuals,
                        const float* __restrict behind,
                        std::size_t count,
                        float unlike,
                        float scale,
                        float bound,
                        float* __restrict roots,
                        float* __restrict pulls) {
  float weights = 0, trusted = 0, misfit = 0, scores = 0, slopes = 0;
  const float per_scale = 1 / (16 * scale * scale);
  const float per_bound = 1 / bound;
#pragma omp simd reduction(+ : weights, trusted, misfit, scores, slopes)
  for (std::size_t i = 0; i < count; ++i) {
    const float trust = 1 / (1 + unlike * behind[i] * behind[i]);
    const float square = residuals[i] * residuals[i];
    const float z2 = square * trust * per_scale;
    const float left = z2 < 1 ? 1 - z2 : 0.0F;
    const float robust = left * left;
    trusted += trust;
    misfit += trust * square / (1 + square * per_bound);
    const float w = trust * robust;
    weights += w;
    scores += w * robust * square;
    slopes += trust * left * (1 - 5 * z2);
    const float root = std::sqrt(w);
    roots[i] = root;
    pulls[i] = root * residuals[i];
  }
  return {weights, trusted, misfit, scores, slopes};
}

LIMN_SIMD void add_products(const float* __restrict columns,
                            int number,
                            std::size_t count,
                            const float* __restrict right,
                            double* __restrict information,
                            double* __restrict products) {
  constexpr int k_rows = 2;
  static_assert(k_fours % k_rows == 0);
  for (int i = 0; i < number; i += k_rows) {
    const float* a0 = columns + static_cast<std::size_t>(i) * count;
    const float* a1 = a0 + count;
    float right0 = 0, right1 = 0;
#pragma omp simd reduction(+ : right0, right1)
    for (std::size_t k = 0; k < count; ++k) right0 += a0[k] * right[k], right1 += a1[k] * right[k];
    products[i] = right0, products[i + 1] = right1;
    for (int j = 0; j <= i; j += k_fours) {
      const float* b0 = columns + static_cast<std::size_t>(j) * count;
      const float* b1 = b0 + count;
      const float* b2 = b1 + count;
      const float* b3 = b2 + count;
      float s0 = 0, s1 = 0, s2 = 0, s3 = 0, t0 = 0, t1 = 0, t2 = 0, t3 = 0;
#pragma omp simd reduction(+ : s0, s1, s2, s3, t0, t1, t2, t3)
      for (std::size_t k = 0; k < count; ++k) {
        s0 += a0[k] * b0[k], s1 += a0[k] * b1[k], s2 += a0[k] * b2[k], s3 += a0[k] * b3[k];
        t0 += a1[k] * b0[k], t1 += a1[k] * b1[k], t2 += a1[k] * b2[k], t3 += a1[k] * b3[k];
      }
      double* row = information + i * number + j;
      row[0] = s0, row[1] = s1, row[2] = s2, row[3] = s3;
      row += number;
      row[0] = t0, row[1] = t1, row[2] = t2, row[3] = t3;
    }
  }
}

LIMN_SIMD void sum_blocks(const float* __restrict derivatives,
                          const float* __restrict by,
                          std::size_t number,
                          std::size_t stride,
                          const float* __restrict pulls,
                          const float* __restrict level_x,
                          const float* __restrict level_y,
                          std::size_t count,
                          BlockSums* __restrict sums) {
  for (std::size_t i = 0; i < count; ++i) {
    float move[8] = {};
    for (std::size_t a = 0; a < number; ++a) {
      const float pulled = pulls[i] * derivatives[a * stride + i];
#pragma omp simd
      for (int j = 0; j < 8; ++j) move[j] += pulled * by[8 * a + static_cast<std::size_t>(j)];
    }
    int at[2];
    for (int axis = 0; axis < 2; ++axis) {
      const float place = (0.5F * (axis == 0 ? level_x : level_y)[i] + 0.5F) * k_blocks;
      at[axis] = place > 0 ? place < k_blocks ? static_cast<int>(place) : k_blocks - 1 : 0;
    }
    float* block = sums->blocks + 8 * (k_blocks * at[1] + at[0]);
#pragma omp simd
    for (int j = 0; j < 8; ++j) block[j] += move[j];
    for (int k = 0; k < 8; ++k) {
#pragma omp simd
      for (int j = 0; j < 8; ++j) sums->products[8 * k + j] += move[k] * move[j];
    }
  }
}

}  // namespace limn::tracker::pattern
