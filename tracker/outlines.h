#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "tracker/threshold.h"

namespace limn::tracker {

/// The outer boundaries of the connected black regions (8-connected, along the cracks between pixels), one
/// after the other. Points of a boundary are the middles of its cracks, clockwise as seen (x right, y down).
/// Holds its buffers between calls.
class Outlines {
 public:
  /// Of a boundary as it is traced.
  struct Extent {
    std::size_t count = 0;  ///< cracks
    double width = 0, height = 0;
    double area = 0;  ///< square pixels; negative around a hole
  };
  /// Total least squares line of some points.
  struct Line {
    Eigen::Vector2d p, d;  ///< centroid, unit direction along the boundary
    double squares = 0;    ///< sum of squared distances, px^2
    double count = 0;
    double rms() const { return std::sqrt(squares / count); }
  };

  /// Calls visit(extent) with every boundary; what follows is about that one. Sets the visited bits of
  /// `corners`.
  template <typename Visit>
  void for_each(CornerCodes& corners, const Visit& visit) {
    steps_ = Steps(corners.stride);
    for (Start start = first(corners); start.y < corners.height; start = next(corners, start))
      visit(trace(corners, start));
  }

  /// Finds the boundary's corners (Douglas and Peucker from two far points), no more than `max_count` and
  /// some; pieces of fewer than `min_run` points are not split further.
  void find_corners(double tolerance_px, std::size_t max_count, std::size_t min_run = 2);

  /// Indices of points, ascending, the first 0. Points are counted from there, and on into a second round.
  std::span<const std::size_t> corners() const { return corners_; }
  std::size_t size() const { return x_.size() - 1; }
  Eigen::Vector2d point(std::size_t i) const { return {0.5 * x_[i], 0.5 * y_[i]}; }

  /// Needed once before line().
  void sum_moments();

  /// Of the points from ... to - 1.
  Line line(std::size_t from, std::size_t to) const;

 private:
  // How a boundary goes on from one corner to the next, by 32 * direction + corner code.
  struct Step {
    std::int32_t offset = 0;  // to the next corner's code
    std::int16_t next = 0;    // 32 * direction
    std::int8_t dx = 0, dy = 0;
  };
  struct Steps {
    std::array<Step, 128> on, back;  // with black on its right, and the other way
    explicit Steps(std::ptrdiff_t stride);
  };
  // One end of what has been traced of a boundary.
  struct End;
  struct Start {
    int x = 0, y = 0;
  };
  struct Moments {  // sums over the boundary's points up to an index
    double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  };
  Steps steps_{0};
  std::vector<float> trail_x_, trail_y_;  // in half pixels
  std::vector<float> back_x_, back_y_;    // what was traced backwards
  std::size_t count_ = 0;
  std::span<const float> x_, y_;  // the same from a corner on, and that one again at the end
  std::vector<Moments> sums_;
  std::vector<std::size_t> corners_, pending_;

  static Start first(const CornerCodes& corners);
  static Start next(const CornerCodes& corners, Start after);
  Extent trace(CornerCodes& corners, Start start);
};

}  // namespace limn::tracker
