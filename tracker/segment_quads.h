#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tracker/candidates.h"
#include "tracker/fork_join.h"
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
  /// Best visible first, `most` at most; each once. The result is the same with any crew.
  void find(std::span<const Segment> segments,
            int width,
            int height,
            std::size_t most,
            std::vector<SegmentQuad>& quads,
            WorkerTeam& team);

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
  // A share of the segments, and what it gives.
  struct Part {
    std::uint32_t first = 0, last = 0;
    std::vector<Segment> joined;
    std::vector<Corner> corners;  // of all its segments, each one's best first
    std::vector<std::uint32_t> corner_end;
    std::vector<SegmentQuad> quads;
    std::vector<Corner> found;          // scratch: of one segment
    std::vector<std::uint8_t> matches;  // scratch: of a run of entries, 1 or 0
  };
  std::vector<Segment> segments_;  // those found, and those joined of two on one line
  Cells cells_;
  std::array<Part, 8> parts_;
  std::vector<std::span<const Corner>> corners_;  // of each segment
  int columns_ = 0, rows_ = 0;

  int cell_of(const Eigen::Vector2d& px) const;
  void sort_into_cells();
  template <typename Match, typename Visit>
  void visit(const Eigen::Vector2d& px,
             double radius,
             const Match& match,
             std::vector<std::uint8_t>& matches,
             const Visit& visit) const;
  template <typename Work>
  void for_each_part(WorkerTeam& team, const Work& work);
  void join_collinear(Part& part) const;
  void find_corners(Part& part);
  void find_quads(Part& part) const;
  void add_quads(std::uint32_t first, std::vector<SegmentQuad>& quads) const;
};

}  // namespace limn::tracker
