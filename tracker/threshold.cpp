#include "tracker/threshold.h"

#include <algorithm>
#include <cstring>

namespace limn::tracker {
namespace {

constexpr int k_tile = 4;

std::size_t index(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

void lowest(const std::uint8_t* a, std::uint8_t* into, int count) {
  for (int i = 0; i < count; ++i) into[i] = std::min(into[i], a[i]);
}
void highest(const std::uint8_t* a, std::uint8_t* into, int count) {
  for (int i = 0; i < count; ++i) into[i] = std::max(into[i], a[i]);
}

}  // namespace

void Threshold::apply(const cv::Mat& grey, int min_contrast, BinaryPicture& binary) {
  measure_tiles(grey);
  widen_tiles();
  compare(grey, min_contrast, binary);
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
    for (int t = 0; t < full; ++t) {
      const std::uint8_t* low = &row_low_[static_cast<std::size_t>(t * k_tile)];
      const std::uint8_t* high = &row_high_[static_cast<std::size_t>(t * k_tile)];
      dark[t] = std::min(std::min(low[0], low[1]), std::min(low[2], low[3]));
      bright[t] = std::max(std::max(high[0], high[1]), std::max(high[2], high[3]));
    }
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

void Threshold::compare(const cv::Mat& grey, int min_contrast, BinaryPicture& binary) {
  binary.width = grey.cols;
  binary.height = grey.rows;
  binary.stride = (grey.cols + 2 * BinaryPicture::k_lead + 7) / 8 * 8;
  binary.pixels.resize(static_cast<std::size_t>(binary.stride) * static_cast<std::size_t>(grey.rows + 2));
  std::memset(binary.pixels.data(), 0, static_cast<std::size_t>(binary.stride));
  std::memset(binary.at(0, grey.rows) - BinaryPicture::k_lead, 0, static_cast<std::size_t>(binary.stride));
  limit_.resize(static_cast<std::size_t>(std::max(grey.cols, tiles_x_ * k_tile)));
  for (int tile_y = 0; tile_y < tiles_y_; ++tile_y) {
    const auto tiles = static_cast<std::size_t>(tiles_x_);
    row_low_.assign(&wide_darkest_[index(0, tile_y, tiles_x_)],
                    &wide_darkest_[index(0, tile_y, tiles_x_)] + tiles);
    row_high_.assign(&wide_brightest_[index(0, tile_y, tiles_x_)],
                     &wide_brightest_[index(0, tile_y, tiles_x_)] + tiles);
    for (const int neighbour : {tile_y - 1, tile_y + 1}) {
      if (neighbour < 0 || neighbour >= tiles_y_) continue;
      lowest(&wide_darkest_[index(0, neighbour, tiles_x_)], row_low_.data(), tiles_x_);
      highest(&wide_brightest_[index(0, neighbour, tiles_x_)], row_high_.data(), tiles_x_);
    }
    for (std::size_t t = 0; t < tiles; ++t) {
      const int low = row_low_[t];
      const int high = row_high_[t];
      const int limit = high - low < min_contrast ? 0 : (low + high + 1) / 2;
      std::memset(&limit_[t * k_tile], limit, k_tile);
    }
    for (std::size_t x = tiles * k_tile; x < limit_.size(); ++x) limit_[x] = limit_[tiles * k_tile - 1];
    const int last = tile_y + 1 == tiles_y_ ? grey.rows : (tile_y + 1) * k_tile;
    for (int y = tile_y * k_tile; y < last; ++y) {
      std::uint8_t* into = binary.at(0, y);
      const std::uint8_t* from = grey.ptr(y);
      const std::uint8_t* limit = limit_.data();
      std::memset(into - BinaryPicture::k_lead, 0, BinaryPicture::k_lead);
      for (int x = 0; x < grey.cols; ++x) into[x] = from[x] < limit[x] ? BinaryPicture::k_black : 0;
      std::uint8_t* row_end = binary.at(0, y) - BinaryPicture::k_lead + binary.stride;
      std::memset(into + grey.cols, 0, static_cast<std::size_t>(row_end - (into + grey.cols)));
    }
  }
}

}  // namespace limn::tracker
