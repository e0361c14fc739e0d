#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "tracker/contours.h"
#include "tracker/threshold.h"

namespace limn::tracker {

/// A straight piece of an edge, in pixels of the whole image. Dark lies to the right of the direction from
/// `from` to `to` as seen (x right, y down).
struct Segment {
  Eigen::Vector2d from, to;
  Eigen::Vector2d direction;  ///< unit
  double length = 0;
};

/// Straight pieces of outlines.
struct Segments {
  /// Edges of nearly black regions, at half the image's size. A marker's ink remains, while shadows, fingers
  /// and lighter paper that lie over it are cut off.
  std::vector<Segment> of_black;
  /// Edges of regions darker than the middle level, at a quarter of the size. Strong blur leaves no black.
  std::vector<Segment> of_blurred;
};

/// Holds its buffers between calls.
class SegmentFinder {
 public:
  /// `grey` is 8-bit, one channel. Regions whose levels differ by less than `min_contrast` have no segments.
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
