#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "tracker/threshold.h"

namespace limn::tracker {

/// A dark quadrilateral of the picture; corners clockwise as seen (x right, y down), pixel centres at
/// integers, good to about a pixel.
struct Quad {
  std::array<Eigen::Vector2d, 4> corners_px;
  double within_px = 3;  ///< how far off a corner may be
};

struct CandidateOptions {
  /// Sides shorter than this are none: a marker of 8 cells cannot be read below some 11 px. A steep marker's
  /// height may be half of it.
  double min_side_px = 6;
};

/// Traces the outer boundaries of the connected black regions (8-connected, along the cracks between pixels)
/// and keeps those that four straight lines describe. Holds its buffers between calls.
class QuadFinder {
 public:
  /// Sets the visited bits of `corners`.
  void find(CornerCodes& corners, const CandidateOptions& options, std::vector<Quad>& quads);

 private:
  struct Crack {  // middle of a boundary crack, in half pixels
    int x, y;
  };
  struct Moments {  // sums over the boundary's points up to an index
    double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  };
  struct Line {
    Eigen::Vector2d p, d;  // centroid, unit direction
    double squares = 0;    // sum of squared distances, px^2
    double count = 0;
  };
  std::vector<Crack> trail_;  // grows; boundary_ is its used part
  std::span<Crack> boundary_;
  std::vector<Moments> sums_;
  std::vector<std::size_t> corners_;

  void trace(CornerCodes& corners, int x, int y);
  bool may_be_quad(double min_side_px) const;
  void split(std::size_t from, std::size_t to, double tolerance);
  bool find_corners();
  void sum_moments();
  Line line(std::size_t from, std::size_t to) const;
  bool choose_quad(double min_side_px, Quad* quad) const;
  bool fit_quad(const std::array<std::size_t, 4>& corners,
                double min_side_px,
                Quad* quad,
                double* squares) const;
};

}  // namespace limn::tracker
