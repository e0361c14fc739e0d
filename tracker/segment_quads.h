#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tracker/candidates.h"
#include "tracker/fork_join.h"
#include "tracker/segments.h"

namespace limn::tracker {

/// A quadrilateral that four straight edges form.
struct SegmentQuad {
  Quad quad;
  double visible = 0;  ///< share of its outline that the segments cover
};

/// Joins straight edges, dark on their right, to quadrilaterals. Each side may be visible in part only, and
/// corners may be hidden (Olson 2011, "AprilTag: a robust and flexible visual fiducial system", joins
/// segments likewise). Holds its buffers between calls.
class SegmentQuadFinder {
 public:
  /// Finds at most `most` quadrilaterals, each once, best visible first. The result does not depend on the
  /// team's size.
  void find(std::span<const Segment> segments,
            int width,
            int height,
            std::size_t most,
            std::vector<SegmentQuad>& quads,
            WorkerTeam& team);

 private:
  struct Corner {
    std::uint32_t next;  // index of the segment that the outline turns to
    double cost;         // sum of the gaps over sum of the lengths
    Eigen::Vector2d px;
  };
  struct Cells {  // a grid of k_cell_px: the segments, sorted by the cell where they begin
    std::vector<std::uint32_t> begin;  // first entry of every cell, then the end
    std::vector<std::uint32_t> segment;
    std::vector<float> x, y, dx, dy, length;  // start, direction and length of each entry's segment
  };
  // A share of the segments, and its results.
  struct Part {
    std::uint32_t first = 0, last = 0;
    std::vector<Segment> joined;
    std::vector<Corner> corners;  // corners of all segments of the part; each segment's best first
    std::vector<std::uint32_t> corner_end;
    std::vector<SegmentQuad> quads;
    std::vector<Corner> found;          // scratch: corners of one segment
    std::vector<std::uint8_t> matches;  // scratch: 1 or 0 for each entry of a run
  };
  std::vector<Segment> segments_;  // the found segments, then those joined from two on one line
  Cells cells_;
  std::array<Part, 8> parts_;
  std::vector<std::span<const Corner>> corners_;  // one entry for each segment
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
