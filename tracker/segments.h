#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace limn::tracker {

/// A straight piece of edge, pixels of the whole picture; dark lies on the right of the way from `from` to
/// `to` as seen (x right, y down).
struct Segment {
  Eigen::Vector2d from, to;
  Eigen::Vector2d direction;  ///< unit
  double length = 0;
};

/// Straight edges of the picture at half its size. Pixels whose gradient is a maximum across the edge are
/// followed along a line that is fitted on the way, over gaps of a few pixels, so that the rim of a shadow
/// that crosses an edge does not end it. Holds its buffers between calls.
class SegmentFinder {
 public:
  /// `grey` is 8-bit, one channel. Edges of less than `min_contrast` levels are not followed.
  void find(const cv::Mat& grey, int min_contrast, std::vector<Segment>& segments);

 private:
  int width_ = 0, height_ = 0;
  std::vector<std::uint8_t> half_;           // the picture at half size
  std::vector<std::int16_t> across_, down_;  // Sobel gradients of a row
  std::vector<std::uint16_t> strength_;      // |across| + |down|, of three rows
  // 0, or the way of the gradient of an edge pixel that no segment holds yet: 256ths of a turn, lowest bit
  // set.
  std::vector<std::uint8_t> ridge_;

  struct Line {  // running fit, half-size pixels from its origin
    int origin_x = 0, origin_y = 0;
    float n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    float next_fit = 3;
    Eigen::Vector2f middle = Eigen::Vector2f::Zero(), direction;
    float way = 0;  // of the gradients of an edge along it
    void add(float px, float py) {
      n += 1, x += px, y += py;
      xx += px * px, xy += px * py, yy += py * py;
    }
    void fit();
  };

  void halve(const cv::Mat& grey);
  void find_ridges(int min_strength);
  bool follow(int x, int y, Segment* segment);
  Eigen::Vector2i walk(Line& line, const Eigen::Vector2i& start, int way);
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }
};

}  // namespace limn::tracker
