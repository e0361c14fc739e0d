#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tracker/candidates.h"
#include "tracker/segments.h"

namespace limn::tracker {

/// A quadrilateral that four straight edges suggest.
struct SegmentQuad {
  Quad quad;
  double visible = 0;  ///< share of its outline that the segments cover
};

/// Joins straight edges, dark on their right, to quadrilaterals: each side may be seen in part only, and
/// corners may be hidden (Olson 2011, "AprilTag: a robust and flexible visual fiducial system", joins
/// segments likewise). Holds its buffers between calls.
class SegmentQuadFinder {
 public:
  /// Best visible first; each once.
  void find(std::span<const Segment> segments, int width, int height, std::vector<SegmentQuad>& quads);

 private:
  struct Corner {
    std::uint32_t next;  // to which the outline turns
    double cost;         // gaps over lengths
    Eigen::Vector2d px;
  };
  struct Cells {                       // of k_cell_px: the segments by where they begin
    std::vector<std::uint32_t> begin;  // first entry of every cell, and the end
    std::vector<std::uint32_t> segment;
    std::vector<float> x, y, dx, dy, length;  // where it begins, its direction and length
  };
  std::vector<Segment> segments_;  // those found, and those joined of two on one line
  Cells cells_;
  std::vector<Corner> found_;    // scratch: of one segment
  std::vector<Corner> corners_;  // of all segments, each one's best first
  std::vector<std::uint32_t> corner_begin_;
  std::vector<std::uint8_t> matches_;  // scratch: of a run of entries, 1 or 0
  int columns_ = 0, rows_ = 0;

  int cell_of(const Eigen::Vector2d& px) const;
  void sort_into_cells();
  template <typename Match, typename Visit>
  void visit(const Eigen::Vector2d& px, double radius, const Match& match, const Visit& visit);
  void join_collinear();
  void find_corners();
  std::span<const Corner> corners_of(std::uint32_t segment) const;
  void add_quads(std::uint32_t first, std::vector<SegmentQuad>& quads) const;
};

}  // namespace limn::tracker
