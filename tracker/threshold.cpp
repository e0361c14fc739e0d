#include "tracker/threshold.h"

#include <algorithm>
#include <array>

#include "tracker/simd.h"

namespace limn::tracker {
namespace {

constexpr int k_shares = 3;  // shares of the work for each thread, because some threads start late

constexpr int k_tile = 4;

// The range of a flat tile's 16 levels is 3.5 standard deviations of the noise on average; three in ten flat
// tiles have less than 3.1.
constexpr double k_tile_range_deviations = 3.1;
constexpr double k_flat_share = 0.3;
// The range over the surroundings, 144 pixels, reaches 8 deviations once in ten thousand places.
constexpr double k_noise_contrast = 8;
constexpr double k_min_noise = 2.4;        // levels: less noise does not reach the smallest contrast
constexpr int k_most_noise_contrast = 28;  // more is texture or clutter
constexpr int k_every_row = 4;             // one of this many rows of tiles is measured
// Levels that are cut off show less noise.
constexpr int k_lowest_level = 2, k_highest_level = 253;

std::size_t index(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

// Minima and maxima over four rows of pixels.
LIMN_SIMD void join_four_rows(const std::array<const std::uint8_t*, k_tile> rows,
                              int count,
                              std::uint8_t* __restrict low,
                              std::uint8_t* __restrict high) {
  static_assert(k_tile == 4);
  const std::uint8_t *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3];
  for (int i = 0; i < count; ++i) {
    low[i] = std::min(std::min(a[i], b[i]), std::min(c[i], d[i]));
    high[i] = std::max(std::max(a[i], b[i]), std::max(c[i], d[i]));
  }
}

LIMN_SIMD void join_row(const std::uint8_t* row,
                        int count,
                        std::uint8_t* __restrict low,
                        std::uint8_t* __restrict high) {
  for (int i = 0; i < count; ++i) {
    low[i] = std::min(low[i], row[i]);
    high[i] = std::max(high[i], row[i]);
  }
}

LIMN_SIMD void lowest(const std::uint8_t* a,
                      const std::uint8_t* b,
                      const std::uint8_t* c,
                      int count,
                      std::uint8_t* __restrict into) {
  for (int i = 0; i < count; ++i) into[i] = std::min(std::min(a[i], b[i]), c[i]);
}
LIMN_SIMD void highest(const std::uint8_t* a,
                       const std::uint8_t* b,
                       const std::uint8_t* c,
                       int count,
                       std::uint8_t* __restrict into) {
  for (int i = 0; i < count; ++i) into[i] = std::max(std::max(a[i], b[i]), c[i]);
}

// The smallest of every four values in `low`, and the largest of every four in `high`.
LIMN_SIMD void join_fours(const std::uint8_t* low,
                          const std::uint8_t* high,
                          int count,
                          std::uint8_t* smallest,
                          std::uint8_t* largest) {
  static_assert(k_tile == 4);
  for (int t = 0; t < count; ++t) {
    smallest[t] = std::min(std::min(low[4 * t], low[4 * t + 1]), std::min(low[4 * t + 2], low[4 * t + 3]));
    largest[t] = std::max(std::max(high[4 * t], high[4 * t + 1]), std::max(high[4 * t + 2], high[4 * t + 3]));
  }
}

LIMN_SIMD void darker(const std::uint8_t* grey, const std::uint8_t* limit, int count, std::uint8_t* black) {
  for (int x = 0; x < count; ++x) black[x] = grey[x] < limit[x];
}

// Rows of black pixels start with the white pixel left of the image.
LIMN_SIMD void corner_row(const std::uint8_t* above,
                          const std::uint8_t* here,
                          int count,
                          std::uint8_t* codes) {
  for (int x = 0; x < count; ++x)
    codes[x] = static_cast<std::uint8_t>(above[x] | above[x + 1] << 1 | here[x] << 2 | here[x + 1] << 3);
}

// The thresholds of tiles, repeated for each pixel of a row.
LIMN_SIMD void limits_between(const std::uint8_t* low,
                              const std::uint8_t* high,
                              int count,
                              const ThresholdOptions options,
                              std::uint8_t* __restrict limit) {
  static_assert(k_tile == 4);
  for (int t = 0; t < count; ++t) {
    const int range = high[t] - low[t];
    const int level = low[t] + ((range * options.share + 255) >> 8);
    const std::uint32_t in_all =
        (range < options.min_contrast ? 0U : static_cast<std::uint32_t>(level)) * 0x01010101U;
    __builtin_memcpy(limit + k_tile * t, &in_all, k_tile);
  }
}

}  // namespace

void Threshold::apply(const cv::Mat& grey,
                      const ThresholdOptions& options,
                      CornerCodes& corners,
                      WorkerTeam& team) {
  tiles_x_ = std::max(1, grey.cols / k_tile);
  tiles_y_ = std::max(1, grey.rows / k_tile);
  const auto count = static_cast<std::size_t>(tiles_x_) * static_cast<std::size_t>(tiles_y_);
  for (auto* tiles : {&darkest_, &brightest_, &wide_darkest_, &wide_brightest_}) tiles->resize(count);
  corners.width = grey.cols;
  corners.height = grey.rows;
  corners.stride = grey.cols + 1;
  corners.codes.resize(static_cast<std::size_t>(corners.stride) * static_cast<std::size_t>(grey.rows + 1));
  const int shares = team.size() == 1 ? 1 : k_shares * team.size();
  rows_.resize(static_cast<std::size_t>(shares));
  team.parallel_for(shares, [&](int i) {
    Rows& rows = rows_[static_cast<std::size_t>(i)];
    rows.first = tiles_y_ * i / shares;
    rows.last = tiles_y_ * (i + 1) / shares;
    measure_tiles(grey, rows);
    widen_tiles(rows.first, rows.last);
  });
  ThresholdOptions limits = options;
  if (options.above_noise) limits.min_contrast = contrast_above_noise(options.min_contrast);
  is_noisy_ = limits.min_contrast > options.min_contrast;
  for (int reach = 1; reach < options.reach; ++reach) {
    join_rows();
    widen_tiles(0, tiles_y_);
  }
  team.parallel_for(shares,
                    [&](int i) { compare(grey, limits, rows_[static_cast<std::size_t>(i)], corners); });
}

int Threshold::contrast_above_noise(int min_contrast) const {
  std::array<int, 256> tiles{};  // by their range
  int count = 0;
  for (int y = k_every_row / 2; y < tiles_y_; y += k_every_row)
    for (int x = 0; x < tiles_x_; ++x) {
      const std::size_t i = index(x, y, tiles_x_);
      if (darkest_[i] < k_lowest_level || brightest_[i] > k_highest_level) continue;
      ++tiles[static_cast<std::size_t>(brightest_[i] - darkest_[i])];
      ++count;
    }
  int below = 0, range = 0;
  while (range < 255 && below + tiles[static_cast<std::size_t>(range)] <= k_flat_share * count)
    below += tiles[static_cast<std::size_t>(range++)];
  const double noise = range / k_tile_range_deviations;
  if (noise < k_min_noise) return min_contrast;
  return std::max(min_contrast, std::min(k_most_noise_contrast, static_cast<int>(k_noise_contrast * noise)));
}

// The last tile of a row or column also includes the remaining pixels, which are too few for a tile.
void Threshold::measure_tiles(const cv::Mat& grey, Rows& rows) {
  const auto width = static_cast<std::size_t>(grey.cols);
  rows.low.resize(width);
  rows.high.resize(width);
  for (int tile_y = rows.first; tile_y < rows.last; ++tile_y) {
    const int first = tile_y * k_tile;
    const int last = tile_y + 1 == tiles_y_ ? grey.rows : first + k_tile;
    const auto row = [&](int i) { return grey.ptr(std::min(first + i, last - 1)); };
    join_four_rows({row(0), row(1), row(2), row(3)}, grey.cols, rows.low.data(), rows.high.data());
    for (int y = first + k_tile; y < last; ++y)
      join_row(grey.ptr(y), grey.cols, rows.low.data(), rows.high.data());
    std::uint8_t* dark = &darkest_[index(0, tile_y, tiles_x_)];
    std::uint8_t* bright = &brightest_[index(0, tile_y, tiles_x_)];
    const int full = grey.cols >= k_tile ? tiles_x_ : 0;
    join_fours(rows.low.data(), rows.high.data(), full, dark, bright);
    if (full == 0) {
      dark[0] = rows.low[0];
      bright[0] = rows.high[0];
    }
    for (std::size_t x = static_cast<std::size_t>(full * k_tile); x < width; ++x) {
      dark[tiles_x_ - 1] = std::min(dark[tiles_x_ - 1], rows.low[x]);
      bright[tiles_x_ - 1] = std::max(bright[tiles_x_ - 1], rows.high[x]);
    }
  }
}

// Computes each tile's extremes over itself and its left and right neighbours. join_wide_rows() joins three
// such rows.
void Threshold::widen_tiles(int first, int last) {
  for (int y = first; y < last; ++y) {
    const std::size_t row = index(0, y, tiles_x_);
    const auto widen = [&](const std::uint8_t* tiles, std::uint8_t* wide, const auto& join) {
      const int end = tiles_x_ - 1;
      join(tiles, tiles, tiles + std::min(1, end), 1, wide);
      join(tiles, tiles + 1, tiles + 2, end - 1, wide + 1);
      join(tiles + std::max(0, end - 1), tiles + end, tiles + end, 1, wide + end);
    };
    widen(&darkest_[row], &wide_darkest_[row], lowest);
    widen(&brightest_[row], &wide_brightest_[row], highest);
  }
}

// The extremes over the rows of tiles above, here and below.
void Threshold::join_wide_rows(int tile_y, std::uint8_t* low, std::uint8_t* high) const {
  const std::size_t above = index(0, std::max(0, tile_y - 1), tiles_x_), here = index(0, tile_y, tiles_x_);
  const std::size_t below = index(0, std::min(tiles_y_ - 1, tile_y + 1), tiles_x_);
  lowest(&wide_darkest_[above], &wide_darkest_[here], &wide_darkest_[below], tiles_x_, low);
  highest(&wide_brightest_[above], &wide_brightest_[here], &wide_brightest_[below], tiles_x_, high);
}

// Stores the joined rows as new tiles.
void Threshold::join_rows() {
  for (int y = 0; y < tiles_y_; ++y) {
    const std::size_t row = index(0, y, tiles_x_);
    join_wide_rows(y, &darkest_[row], &brightest_[row]);
  }
}

// Computes the thresholds for the pixels in a row of tiles.
void Threshold::set_limits(int tile_y, const ThresholdOptions& options, Rows& rows) const {
  const auto tiles = static_cast<std::size_t>(tiles_x_);
  join_wide_rows(tile_y, rows.low.data(), rows.high.data());
  limits_between(rows.low.data(), rows.high.data(), tiles_x_, options, rows.limit.data());
  std::fill(rows.limit.begin() + static_cast<std::ptrdiff_t>(tiles * k_tile), rows.limit.end(),
            rows.limit[tiles * k_tile - 1]);
}

void Threshold::compare(const cv::Mat& grey,
                        const ThresholdOptions& options,
                        Rows& rows,
                        CornerCodes& corners) const {
  const auto width = static_cast<std::size_t>(grey.cols);
  const auto tiles = static_cast<std::size_t>(tiles_x_);
  rows.above.assign(width + 2, 0);
  rows.here.assign(width + 2, 0);
  rows.limit.resize(std::max(width, tiles * k_tile));
  rows.low.resize(tiles);
  rows.high.resize(tiles);
  const auto write = [&](int y) {
    corner_row(rows.above.data(), rows.here.data(), grey.cols + 1, corners.at(0, y));
  };
  if (rows.first > 0 && rows.first < rows.last) {
    set_limits(rows.first - 1, options, rows);
    darker(grey.ptr(rows.first * k_tile - 1), rows.limit.data(), grey.cols, rows.above.data() + 1);
  }
  for (int tile_y = rows.first; tile_y < rows.last; ++tile_y) {
    set_limits(tile_y, options, rows);
    const int last = tile_y + 1 == tiles_y_ ? grey.rows : (tile_y + 1) * k_tile;
    for (int y = tile_y * k_tile; y < last; ++y) {
      darker(grey.ptr(y), rows.limit.data(), grey.cols, rows.here.data() + 1);
      write(y);
      std::swap(rows.above, rows.here);
    }
  }
  if (rows.first == rows.last || rows.last != tiles_y_) return;
  std::fill(rows.here.begin(), rows.here.end(), std::uint8_t{0});
  write(grey.rows);
}

}  // namespace limn::tracker
