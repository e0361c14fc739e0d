#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>

#include "tracker/contours.h"
#include "tracker/threshold.h"

namespace limn::tracker {

/// A dark quadrilateral of the image; corners clockwise as seen (x right, y down), pixel centres at
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

/// Keeps the outlines of black regions that four straight lines describe. Holds its buffers between calls.
class QuadFinder {
 public:
  /// Sets the visited bits of `corners`. Each quadrilateral is told when it is found.
  void find(CornerCodes& corners,
            const CandidateOptions& options,
            const std::function<void(const Quad&)>& tell);

 private:
  struct Side {
    Contours::Line line;
    bool known = false, straight = false;
  };
  static constexpr std::size_t k_max_corners = 10;
  Contours contours_;
  std::array<Eigen::Vector2d, k_max_corners> corners_;                // of the outline
  std::array<std::array<Side, k_max_corners>, k_max_corners> sides_;  // from corner to corner

  const Side& side(std::size_t from, std::size_t to);
  bool turns_right(std::size_t a, std::size_t b, std::size_t c) const;
  bool choose_quad(double min_side_px, Quad* quad);
  bool fit_quad(const std::array<std::size_t, 4>& corners, double min_side_px, Quad* quad);
};

}  // namespace limn::tracker
