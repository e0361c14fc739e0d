#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>

#include "tracker/contours.h"
#include "tracker/threshold.h"

namespace limn::tracker {

/// A dark quadrilateral in the image. Corners run clockwise as seen (x right, y down), with pixel centres at
/// integers, and are good to about a pixel.
struct Quad {
  std::array<Eigen::Vector2d, 4> corners_px;
  double within_px = 3;  ///< how far off a corner may be
};

struct CandidateOptions {
  /// Quadrilaterals whose longest side is shorter than this are ignored: a marker of 8 cells cannot be read
  /// below some 11 px. The height of a steep marker may be half of it.
  double min_side_px = 6;
};

/// Finds the outlines of black regions that four straight lines describe. Holds its buffers between calls.
class QuadFinder {
 public:
  /// Calls on_quad(quad) for each quadrilateral when it is found. Sets the visited bits of `corners`.
  void find(CornerCodes& corners,
            const CandidateOptions& options,
            const std::function<void(const Quad&)>& on_quad);

 private:
  struct Side {
    Contours::Line line;
    bool known = false, straight = false;
  };
  static constexpr std::size_t k_max_corners = 10;
  Contours contours_;
  std::array<Eigen::Vector2d, k_max_corners> corners_;                // corners of the outline
  std::array<std::array<Side, k_max_corners>, k_max_corners> sides_;  // from one corner to another

  const Side& side(std::size_t from, std::size_t to);
  bool turns_right(std::size_t a, std::size_t b, std::size_t c) const;
  bool choose_quad(double min_side_px, Quad* quad);
  bool fit_quad(const std::array<std::size_t, 4>& corners, double min_side_px, Quad* quad);
};

}  // namespace limn::tracker
