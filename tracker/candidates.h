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
  struct Steps;
  struct Outline {  // of the boundary traced last; half pixels
    std::size_t count = 0;
    int low_x = 0, high_x = 0, low_y = 0, high_y = 0;
    long long area = 0;  // in half square pixels; negative around a hole
  };
  struct Moments {  // sums over the boundary's points up to an index
    double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  };
  struct Side {
    Eigen::Vector2d p, d;  // centroid, unit direction; pixels
    double squares = 0;    // sum of squared distances, px^2
    double count = 0;
    bool known = false, straight = false;
  };
  static constexpr std::size_t k_max_corners = 10;
  std::vector<float> trail_x_, trail_y_;  // middles of the boundary's cracks, in half pixels
  std::span<const float> x_, y_;          // the same from a corner on, and that one again at the end
  std::vector<Moments> sums_;
  std::vector<std::size_t> corners_;
  std::array<std::array<Side, k_max_corners>, k_max_corners> sides_;  // from corner to corner

  Outline trace(CornerCodes& corners, const Steps& steps, int x, int y);
  bool find_corners(std::size_t count);
  void split(std::size_t from, std::size_t to, float tolerance);
  void sum_moments();
  const Side& side(std::size_t from, std::size_t to);
  bool choose_quad(double min_side_px, Quad* quad);
  bool fit_quad(const std::array<std::size_t, 4>& corners, double min_side_px, Quad* quad);
  Eigen::Vector2d point(std::size_t i) const { return {0.5 * x_[i], 0.5 * y_[i]}; }
};

}  // namespace limn::tracker
