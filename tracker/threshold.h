#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "tracker/fork_join.h"

namespace limn::tracker {

/// A black-and-white image as codes of its pixels' corners: which of the four pixels about the corner are
/// black. Beside the image all is white. Corner (x, y) is the upper left one of pixel (x, y), so there is
/// one more of them along rows and columns than pixels.
struct CornerCodes {
  static constexpr std::uint8_t k_upper_left = 1, k_upper_right = 2, k_lower_left = 4, k_lower_right = 8;
  static constexpr std::uint8_t k_visited = 16;  ///< bit: the boundary through this corner has been traced

  int width = 0;  ///< of the image
  int height = 0;
  std::ptrdiff_t stride = 0;
  std::vector<std::uint8_t> codes;

  std::uint8_t* at(int x, int y) { return codes.data() + y * stride + x; }
  const std::uint8_t* at(int x, int y) const { return codes.data() + y * stride + x; }
};

struct ThresholdOptions {
  int min_contrast = 16;
  /// Of the way from the darkest to the brightest where the limit lies, in 256ths.
  int share = 128;
  /// How many tiles of 4 pixels away the surroundings end.
  int reach = 1;
};

/// Black where a pixel is darker than the limit between the darkest and the brightest of its surroundings,
/// tiles of 4 x 4 pixels (Olson 2011, "AprilTag: a robust and flexible visual fiducial system", takes the
/// middle and one tile around). Where these differ by less than min_contrast all is white, so that flat
/// regions stay empty: a marker's border keeps its outer edge, which is all that is traced. Holds its buffers
/// between calls.
class Threshold {
 public:
  /// `grey` is 8-bit, one channel, not empty. The result is the same with any crew.
  void apply(const cv::Mat& grey, const ThresholdOptions& options, CornerCodes& corners, WorkerTeam& team);

 private:
  // What a thread writes on the way through its rows of tiles.
  struct Rows {
    int first = 0, last = 0;
    std::vector<std::uint8_t> low, high, limit;
    std::vector<std::uint8_t> above, here;  // black pixels of two rows, from column -1
  };
  int tiles_x_ = 0;
  int tiles_y_ = 0;
  std::vector<std::uint8_t> darkest_, brightest_;            // per tile
  std::vector<std::uint8_t> wide_darkest_, wide_brightest_;  // per tile, of a row of three
  std::vector<Rows> rows_;                                   // one for each of the crew

  void measure_tiles(const cv::Mat& grey, Rows& rows);
  void widen_tiles(int first, int last);
  void join_wide_rows(int tile_y, std::uint8_t* low, std::uint8_t* high) const;
  void join_rows();
  void set_limits(int tile_y, const ThresholdOptions& options, Rows& rows) const;
  void compare(const cv::Mat& grey, const ThresholdOptions& options, Rows& rows, CornerCodes& corners) const;
};

}  // namespace limn::tracker
