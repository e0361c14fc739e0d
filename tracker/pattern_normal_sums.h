#pragma once

#include <cstddef>
#include <cstdint>

/// Loops over the samples of pattern_fit, compiled for every kind of processor (simd.h).
namespace limn::tracker::pattern {

/// Columns are processed in groups of this many, padded with zeros.
inline constexpr int k_fours = 4;

void scale_by(const float* factors, std::size_t count, float* values);

/// Replaces the expected values by the residuals, and writes their absolute values to `sizes`.
void compare(const float* light, std::size_t count, float* expected, float* sizes);

/// Finds the marker coordinates of samples, -1 to 1, and whether they lie in the marker or within `reach` of
/// a side (one for each side, whose length is 1). Samples diagonally beyond a corner are dropped, because the
/// background there has no model. `square_from_px` is row by row.
void find_places(const float* x,
                 const float* y,
                 std::size_t count,
                 const float* square_from_px,
                 const float* reach,
                 float* level_x,
                 float* level_y,
                 std::int32_t* keeps);

/// The median of values that are not negative; such floats are ordered as their bits.
float median(const float* values, std::size_t count);

struct Unlike {
  float squares, weights;
};

/// The sum of square residuals weighted by the share of the background, and the sum of these shares.
Unlike sum_behind(const float* residuals, const float* behind, std::size_t count);

struct Weights {  ///< sums over the samples
  float weights, trusted, misfit;
  /// Squares of the biweight's score, and its slopes; they give the variance of a robust mean (Huber 1981).
  float scores, slopes;
};

/// Weights residuals by Tukey's biweight, with less weight where the background's share is large and its
/// level uncertain (`unlike`). In `misfit` each square residual counts at most about `bound`, which is a
/// square itself.
Weights weigh(const float* residuals,
              const float* behind,
              std::size_t count,
              float unlike,
              float scale,
              float bound,
              float* roots,
              float* pulls);

/// The products of `number` columns (a multiple of four) of `count` values with one another and with `right`.
/// Writes the lower triangle of `information`, row by row, and the upper part within its blocks of four.
void add_products(const float* columns,
                  int number,
                  std::size_t count,
                  const float* right,
                  double* information,
                  double* products);

inline constexpr int k_blocks = 8;  ///< blocks along a side of the marker

struct BlockSums {
  float blocks[k_blocks * k_blocks * 8];  ///< for each block, the sum of its samples' influence on the shape
  float products[8 * 8];                  ///< the samples' influence, times itself transposed
};

/// Sums the influence of each sample on the shape, from `by`, the covariance between the `number` unknowns
/// and the shape's eight.
void sum_blocks(const float* derivatives,
                const float* by,
                std::size_t number,
                std::size_t stride,
                const float* pulls,
                const float* level_x,
                const float* level_y,
                std::size_t count,
                BlockSums* sums);

}  // namespace limn::tracker::pattern
