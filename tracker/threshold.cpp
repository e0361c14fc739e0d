#include "tracker/threshold.h"

#include <algorithm>
#include <cstring>

#include "tracker/simd.h"

namespace limn::tracker {
namespace {

constexpr int k_shares = 3;  // for each of a crew: some come late

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

void Threshold::apply(const cv::Mat& grey,
                      const ThresholdOptions& options,
                      CornerCodes& corners,
                      Crew& crew) {
  tiles_x_ = std::max(1, grey.cols / k_tile);
  tiles_y_ = std::max(1, grey.rows / k_tile);
  const auto count = static_cast<std::size_t>(tiles_x_) * static_cast<std::size_t>(tiles_y_);
  for (auto* tiles : {&darkest_, &brightest_, &wide_darkest_, &wide_brightest_}) tiles->resize(count);
  corners.width = grey.cols;
  corners.height = grey.rows;
  corners.stride = grey.cols + 1;
  corners.codes.resize(static_cast<std::size_t>(corners.stride) * static_cast<std::size_t>(grey.rows + 1));
  const int shares = crew.size() == 1 ? 1 : k_shares * crew.size();
  rows_.resize(static_cast<std::size_t>(shares));
  crew.at_once(shares, [&](int i) {
    Rows& rows = rows_[static_cast<std::size_t>(i)];
    rows.first = tiles_y_ * i / shares;
    rows.last = tiles_y_ * (i + 1) / shares;
    measure_tiles(grey, rows);
    widen_tiles(rows.first, rows.last);
  });
  for (int reach = 1; reach < options.reach; ++reach) {
    join_rows();
    widen_tiles(0, tiles_y_);
  }
  crew.at_once(shares, [&](int i) { compare(grey, options, rows_[static_cast<std::size_t>(i)], corners); });
}

// A tile at the right or lower end also takes the pixels that are too few for one of their own.
void Threshold::measure_tiles(const cv::Mat& grey, Rows& rows) {
  const auto width = static_cast<std::size_t>(grey.cols);
  for (int tile_y = rows.first; tile_y < rows.last; ++tile_y) {
    const int first = tile_y * k_tile;
    const int last = tile_y + 1 == tiles_y_ ? grey.rows : first + k_tile;
    rows.low.assign(grey.ptr(first), grey.ptr(first) + width);
    rows.high = rows.low;
    for (int y = first + 1; y < last; ++y) {
      lowest(grey.ptr(y), rows.low.data(), grey.cols);
      highest(grey.ptr(y), rows.high.data(), grey.cols);
    }
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

// Each tile's extremes over itself and its left and right neighbours; set_limits() joins three such rows.
void Threshold::widen_tiles(int first, int last) {
  for (int y = first; y < last; ++y) {
    const std::size_t row = index(0, y, tiles_x_);
    const auto tiles = static_cast<std::size_t>(tiles_x_);
    std::copy_n(&darkest_[row], tiles, &wide_darkest_[row]);
    std::copy_n(&brightest_[row], tiles, &wide_brightest_[row]);
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

// The limits of the pixels in a row of tiles.
void Threshold::set_limits(int tile_y, const ThresholdOptions& options, Rows& rows) const {
  const auto tiles = static_cast<std::size_t>(tiles_x_);
  const std::size_t row = index(0, tile_y, tiles_x_);
  rows.low.assign(&wide_darkest_[row], &wide_darkest_[row] + tiles);
  rows.high.assign(&wide_brightest_[row], &wide_brightest_[row] + tiles);
  for (const int neighbour : {tile_y - 1, tile_y + 1}) {
    if (neighbour < 0 || neighbour >= tiles_y_) continue;
    lowest(&wide_darkest_[index(0, neighbour, tiles_x_)], rows.low.data(), tiles_x_);
    highest(&wide_brightest_[index(0, neighbour, tiles_x_)], rows.high.data(), tiles_x_);
  }
  middle_levels(rows.low.data(), rows.high.data(), tiles_x_, options, rows.middle.data());
  for (std::size_t t = 0; t < tiles; ++t) std::memset(&rows.limit[t * k_tile], rows.middle[t], k_tile);
  for (std::size_t x = tiles * k_tile; x < rows.limit.size(); ++x)
    rows.limit[x] = rows.limit[tiles * k_tile - 1];
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
  rows.middle.resize(tiles);
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
