#pragma once

#include <vector>

#include "calib/judge/uncertainty.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// Predicted error over the volume that camera 0 and one projector share: on planes that face camera 0, near
/// to far, each a grid of cells over camera 0's image. Where the centre of a cell lies:
/// px = ((column + 0.5) * width / columns - 0.5, (row + 0.5) * height / rows - 0.5).
struct ErrorMap {
  struct Plane {
    double depth_m = 0;          ///< along camera 0's axis
    std::vector<double> p95_mm;  ///< row by row; NaN where the projector does not reach or nothing is known
  };
  int projector = 0;
  int columns = 0;
  int rows = 0;
  std::vector<Plane> planes;
  /// Largest finite value; 0 when there is none.
  double worst_mm() const;
  /// Between the middles of cells and planes, at a place of camera 0's image (0 to 1 across and down) and
  /// its depth; beyond them as at the nearest. NaN where no neighbour is known.
  double at(const Eigen::Vector2d& place, double depth_m) const;
};

struct ErrorMapOptions {
  int columns = 16;      ///< of cells across camera 0's image; rows follow from its shape
  int planes = 5;        ///< from the nearest to the farthest point of the boards
  double beyond = 0.15;  ///< m in front of and behind them, as far as the prototype may be moved
};

/// One map for each projector: 95 % error (mm) of light meant for the middle of a thing as large as the board
/// that faces camera 0 in that place, and whose pose camera 0 measures.
std::vector<ErrorMap> error_maps(const Observations& observations,
                                 const Solution& solution,
                                 const Uncertainty& uncertainty,
                                 const ErrorMapOptions& options = {});

}  // namespace limn::calib
