#pragma once

#include <cstddef>
#include <cstdint>

/// Loops over the samples of pattern_fit, compiled for every kind of processor (simd.h).
namespace limn::tracker::pattern {

/// Columns of values are taken by so many, rounded up with zeros.
inline constexpr int k_fours = 4;

void scale_by(const float* factors, std::size_t count, float* values);

/// Residuals of what the model expects, in its place, and their sizes.
void compare(const float* light, std::size_t count, float* expected, float* sizes);

/// Where samples lie in the marker, -1 to 1, and whether they are of it or within `reach` of a side (four),
/// whose length is 1. Beside a corner, what is behind the paper has no model. `square_from_px` by rows.
void find_places(const float* x,
                 const float* y,
                 std::size_t count,
                 const float* square_from_px,
                 const float* reach,
                 float* level_x,
                 float* level_y,
                 std::int32_t* keeps);

/// Of values that are not negative, whose order is that of their bits.
float median(const float* values, std::size_t count);

struct Unlike {
  float squares, weights;
};

/// Square residuals where something lies behind the paper.
Unlike sum_behind(const float* residuals, const float* behind, std::size_t count);

struct Weights {  ///< sums
  float weights, trusted, misfit;
  float scores, slopes;  ///< squares of the biweight's, and its slopes: a robust mean's variance (Huber 1981)
};

/// Tukey's biweight of residuals, less where something unlike lies behind the paper; no more misfit than
/// about `bound`, a square, each.
Weights weigh(const float* residuals,
              const float* behind,
              std::size_t count,
              float unlike,
              float scale,
              float bound,
              float* roots,
              float* pulls);

/// The products of `number` columns, a multiple of four, of `count` values each with one another and with
/// `right`: the lower triangle of `information`, row by row, and what is above it in its blocks of four.
void add_products(const float* columns,
                  int number,
                  std::size_t count,
                  const float* right,
                  double* information,
                  double* products);

inline constexpr int k_blocks = 8;  ///< a side of the marker

struct BlockSums {
  float blocks[k_blocks * k_blocks * 8];  ///< of how the samples of each move the shape
  float products[8 * 8];                  ///< of the samples' moves
};

/// How each sample moves the shape, by the covariance between the `number` unknowns and the shape's eight.
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
