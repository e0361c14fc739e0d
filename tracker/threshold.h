#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "tracker/fork_join.h"

namespace limn::tracker {

/// A black-and-white image, stored as a code for each pixel corner that says which of the four pixels around
/// the corner are black. Outside the image everything is white. Corner (x, y) is the upper left one of pixel
/// (x, y), so each row and column has one more corner than pixels.
struct CornerCodes {
  static constexpr std::uint8_t k_upper_left = 1, k_upper_right = 2, k_lower_left = 4, k_lower_right = 8;
  static constexpr std::uint8_t k_visited = 16;  ///< bit: the boundary through this corner has been traced

  int width = 0;  ///< image size
  int height = 0;
  std::ptrdiff_t stride = 0;
  std::vector<std::uint8_t> codes;

  std::uint8_t* at(int x, int y) { return codes.data() + y * stride + x; }
  const std::uint8_t* at(int x, int y) const { return codes.data() + y * stride + x; }
};

struct ThresholdOptions {
  int min_contrast = 16;
  /// The threshold's place between the darkest and the brightest level, in 256ths.
  int share = 128;
  /// Radius of the surroundings, in tiles of 4 pixels.
  int reach = 1;
  /// Raises min_contrast to a multiple of the image's noise where noise alone would reach it, so that flat
  /// regions stay empty in dark rooms as well.
  bool above_noise = false;
};

/// A pixel is black when it is darker than the threshold between the darkest and the brightest level of its
/// surroundings, tiles of 4 x 4 pixels (Olson 2011, "AprilTag: a robust and flexible visual fiducial system",
/// uses the middle level and one tile around). Where these levels differ by less than min_contrast everything
/// is white, so that flat regions stay empty. A marker's border keeps its outer edge, which is all that is
/// traced. Holds its buffers between calls.
class Threshold {
 public:
  /// `grey` is 8-bit, one channel, not empty. The result does not depend on the team's size.
  void apply(const cv::Mat& grey, const ThresholdOptions& options, CornerCodes& corners, WorkerTeam& team);

  /// Whether the last image's noise raised the smallest contrast.
  bool is_noisy() const { return is_noisy_; }

 private:
  // Buffers for one share of the rows of tiles.
  struct Rows {
    int first = 0, last = 0;
    std::vector<std::uint8_t> low, high, limit;
    std::vector<std::uint8_t> above, here;  // two rows of black pixels, starting at column -1
  };
  bool is_noisy_ = false;
  int tiles_x_ = 0;
  int tiles_y_ = 0;
  std::vector<std::uint8_t> darkest_, brightest_;  // per tile
  // Per tile, over itself and its two neighbours in the row.
  std::vector<std::uint8_t> wide_darkest_, wide_brightest_;
  std::vector<Rows> rows_;  // one for each share of the work

  void measure_tiles(const cv::Mat& grey, Rows& rows);
  void widen_tiles(int first, int last);
  void join_wide_rows(int tile_y, std::uint8_t* low, std::uint8_t* high) const;
  void join_rows();
  int contrast_above_noise(int min_contrast) const;
  void set_limits(int tile_y, const ThresholdOptions& options, Rows& rows) const;
  void compare(const cv::Mat& grey, const ThresholdOptions& options, Rows& rows, CornerCodes& corners) const;
};

}  // namespace limn::tracker
