#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace limn::tracker {

/// A black-and-white picture with a white frame of one pixel, so that neighbours always exist.
struct BinaryPicture {
  static constexpr std::uint8_t k_black = 1;    ///< bit: black
  static constexpr std::uint8_t k_visited = 2;  ///< bit: the boundary on its left has been traced

  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;
  std::vector<std::uint8_t> pixels;

  std::uint8_t* at(int x, int y) { return pixels.data() + (y + 1) * stride + x + k_lead; }
  const std::uint8_t* at(int x, int y) const { return pixels.data() + (y + 1) * stride + x + k_lead; }

  static constexpr int k_lead = 8;  ///< white bytes before a row, so that words of 8 may be read from x - 1
};

/// Black where a pixel is darker than the middle of the darkest and the brightest of its surroundings: tiles
/// of 4 x 4 pixels and their 8 neighbours (Olson 2011, "AprilTag: a robust and flexible visual fiducial
/// system", uses the same neighbourhood). Where these differ by less than min_contrast all is white, so that
/// flat regions stay empty: a marker's border keeps its outer edge, which is all that is traced. Holds its
/// buffers between calls.
class Threshold {
 public:
  /// `grey` is 8-bit, one channel, not empty.
  void apply(const cv::Mat& grey, int min_contrast, BinaryPicture& binary);

 private:
  int tiles_x_ = 0;
  int tiles_y_ = 0;
  std::vector<std::uint8_t> darkest_, brightest_;            // per tile
  std::vector<std::uint8_t> wide_darkest_, wide_brightest_;  // per tile, of a row of three
  std::vector<std::uint8_t> row_low_, row_high_, limit_;

  void measure_tiles(const cv::Mat& grey);
  void widen_tiles();
  void compare(const cv::Mat& grey, int min_contrast, BinaryPicture& binary);
};

}  // namespace limn::tracker
