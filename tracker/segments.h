#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "tracker/contours.h"
#include "tracker/threshold.h"

namespace limn::tracker {

/// A straight piece of edge, pixels of the whole image; dark lies on the right of the way from `from` to
/// `to` as seen (x right, y down).
struct Segment {
  Eigen::Vector2d from, to;
  Eigen::Vector2d direction;  ///< unit
  double length = 0;
};

/// Straight pieces of outlines.
struct Segments {
  /// Of what is nearly black, at half the image's size: a marker's ink remains where shadows, fingers and
  /// light paper that lies over it are cut off.
  std::vector<Segment> of_black;
  /// Of what is darker than the middle, at a quarter: strong blur leaves no black.
  std::vector<Segment> of_blurred;
};

/// Holds its buffers between calls.
class SegmentFinder {
 public:
  /// `grey` is 8-bit, one channel. Surroundings whose levels differ by less than `min_contrast` hold none.
  void find(const cv::Mat& grey, int min_contrast, Segments& segments);

 private:
  cv::Mat half_, quarter_;
  Threshold threshold_;
  CornerCodes corner_codes_;
  Contours contours_;

  void add_contours(const cv::Mat& image,
                    int scale,
                    double min_side,
                    const ThresholdOptions& options,
                    std::vector<Segment>& segments);
  void add_sides(int scale, double min_side, std::vector<Segment>& segments);
};

}  // namespace limn::tracker
