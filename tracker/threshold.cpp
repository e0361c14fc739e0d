#include "tracker/threshold.h"

#include <algorithm>
#include <cstring>

#include "tracker/simd.h"

namespace limn::tracker {
namespace {

constexpr int k_tile = 4;

std::size_t index(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

LIMN_SIMD void lowest(const std::uint8_t* a, std::uint8_t* into, int count) {
  for (int i = 0; i < count; ++i) into[i] = std::min(into[i], a[i]);
}
LIMN_SIMD void highest(const std::uint8_t* a, std::uint8_t* into, int count) {
  for (int i = 0; i < count; ++i) into[i] = std::max(into[i], a[i]);
}

// Smallest of every four values, largest of every four others.
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

// Rows of black pixels start with the white one left of the picture.
LIMN_SIMD void corner_row(const std::uint8_t* above,
                          const std::uint8_t* here,
                          int count,
                          std::uint8_t* codes) {
  for (int x = 0; x < count; ++x)
    codes[x] = static_cast<std::uint8_t>(above[x] | above[x + 1] << 1 | here[x] << 2 | here[x + 1] << 3);
}

LIMN_SIMD void middle_levels(const std::uint8_t* low,
                             const std::uint8_t* high,
                             int count,
                             const ThresholdOptions options,
                             std::uint8_t* middle) {
  for (int t = 0; t < count; ++t) {
    const int range = high[t] - low[t];
    const int level = low[t] + ((range * options.share + 255) >> 8);
    middle[t] = static_cast<std::uint8_t>(range < options.min_contrast ? 0 : level);
  }
}

}  // namespace

void Threshold::apply(const cv::Mat& grey, const ThresholdOptions& options, CornerCodes& corners) {
  measure_tiles(grey);
  widen_tiles();
  for (int reach = 1; reach < options.reach; ++reach) {
    join_rows();
    widen_tiles();
  }
  compare(grey, options, corners);
}

// A tile at the right or lower end also takes the pixels that are too few for one of their own.
void Threshold::measure_tiles(const cv::Mat& grey) {
  tiles_x_ = std::max(1, grey.cols / k_tile);
  tiles_y_ = std::max(1, grey.rows / k_tile);
  const auto count = static_cast<std::size_t>(tiles_x_) * static_cast<std::size_t>(tiles_y_);
  darkest_.resize(count);
  brightest_.resize(count);
  const auto width = static_cast<std::size_t>(grey.cols);
  for (int tile_y = 0; tile_y < tiles_y_; ++tile_y) {
    const int first = tile_y * k_tile;
    const int last = tile_y + 1 == tiles_y_ ? grey.rows : first + k_tile;
    row_low_.assign(grey.ptr(first), grey.ptr(first) + width);
    row_high_ = row_low_;
    for (int y = first + 1; y < last; ++y) {
      lowest(grey.ptr(y), row_low_.data(), grey.cols);
      highest(grey.ptr(y), row_high_.data(), grey.cols);
    }
    std::uint8_t* dark = &darkest_[index(0, tile_y, tiles_x_)];
    std::uint8_t* bright = &brightest_[index(0, tile_y, tiles_x_)];
    const int full = grey.cols >= k_tile ? tiles_x_ : 0;
    join_fours(row_low_.data(), row_high_.data(), full, dark, bright);
    if (full == 0) {
      dark[0] = row_low_[0];
      bright[0] = row_high_[0];
    }
    for (std::size_t x = static_cast<std::size_t>(full * k_tile); x < width; ++x) {
      dark[tiles_x_ - 1] = std::min(dark[tiles_x_ - 1], row_low_[x]);
      bright[tiles_x_ - 1] = std::max(bright[tiles_x_ - 1], row_high_[x]);
    }
  }
}

// Each tile's extremes over itself and its left and right neighbours; compare() joins three such rows.
void Threshold::widen_tiles() {
  wide_darkest_ = darkest_;
  wide_brightest_ = brightest_;
  for (int y = 0; y < tiles_y_; ++y) {
    const std::size_t row = index(0, y, tiles_x_);
    lowest(&darkest_[row], wide_darkest_.data() + row + 1, tiles_x_ - 1);
    lowest(darkest_.data() + row + 1, &wide_darkest_[row], tiles_x_ - 1);
    highest(&brightest_[row], wide_brightest_.data() + row + 1, tiles_x_ - 1);
    highest(brightest_.data() + row + 1, &wide_brightest_[row], tiles_x_ - 1);
  }
}

// Each tile's extremes over the rows above and below too, as new tiles.
void Threshold::join_rows() {
  darkest_ = wide_darkest_;
  brightest_ = wide_brightest_;
  for (int y = 0; y < tiles_y_; ++y)
    for (const int neighbour : {y - 1, y + 1}) {
      if (neighbour < 0 || neighbour >= tiles_y_) continue;
      lowest(&wide_darkest_[index(0, neighbour, tiles_x_)], &darkest_[index(0, y, tiles_x_)], tiles_x_);
      highest(&wide_brightest_[index(0, neighbour, tiles_x_)], &brightest_[index(0, y, tiles_x_)], tiles_x_);
    }
}

void Threshold::compare(const cv::Mat& grey, const ThresholdOptions& options, CornerCodes& corners) {
  corners.width = grey.cols;
  corners.height = grey.rows;
  corners.stride = (grey.cols + 1 + 7) / 8 * 8 + 8;  // words of 8 may be read from every corner
  corners.codes.resize(static_cast<std::size_t>(corners.stride) * static_cast<std::size_t>(grey.rows + 1));
  const int beside = grey.cols + 1;
  for (int y = 0; y <= grey.rows; ++y)
    std::fill(corners.at(beside, y), corners.at(0, y) + corners.stride, std::uint8_t{0});
  const auto width = static_cast<std::size_t>(grey.cols);
  const auto tiles = static_cast<std::size_t>(tiles_x_);
  above_.assign(width + 2, 0);
  here_.assign(width + 2, 0);
  limit_.resize(std::max(width, tiles * k_tile));
  middle_.resize(tiles);
  for (int tile_y = 0; tile_y < tiles_y_; ++tile_y) {
    const std::size_t row = index(0, tile_y, tiles_x_);
    row_low_.assign(&wide_darkest_[row], &wide_darkest_[row] + tiles);
    row_high_.assign(&wide_brightest_[row], &wide_brightest_[row] + tiles);
    for (const int neighbour : {tile_y - 1, tile_y + 1}) {
      if (neighbour < 0 || neighbour >= tiles_y_) continue;
      lowest(&wide_darkest_[index(0, neighbour, tiles_x_)], row_low_.data(), tiles_x_);
      highest(&wide_brightest_[index(0, neighbour, tiles_x_)], row_high_.data(), tiles_x_);
    }
    middle_levels(row_low_.data(), row_high_.data(), tiles_x_, options, middle_.data());
    for (std::size_t t = 0; t < tiles; ++t) std::memset(&limit_[t * k_tile], middle_[t], k_tile);
    for (std::size_t x = tiles * k_tile; x < limit_.size(); ++x) limit_[x] = limit_[tiles * k_tile - 1];
    const int last = tile_y + 1 == tiles_y_ ? grey.rows : (tile_y + 1) * k_tile;
    for (int y = tile_y * k_tile; y < last; ++y) {
      darker(grey.ptr(y), limit_.data(), grey.cols, here_.data() + 1);
      corner_row(above_.data(), here_.data(), grey.cols + 1, corners.at(0, y));
      std::swap(above_, here_);
    }
  }
  std::fill(here_.begin(), here_.end(), std::uint8_t{0});
  corner_row(above_.data(), here_.data(), grey.cols + 1, corners.at(0, grey.rows));
}

}  // namespace limn::tracker
