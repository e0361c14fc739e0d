#pragma once

#include <vector>

#include "calib/judge/uncertainty.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// Predicted error over the volume that camera 0 and one projector share: on planes that face camera 0, from
/// near to far, each a grid of cells over camera 0's image. The centre of a cell is at
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
  /// Interpolates between the centres of cells and planes, at a place in camera 0's image (0 to 1 across and
  /// down) and a depth. Outside the volume the nearest value is used. NaN where no neighbour is known.
  double at(const Eigen::Vector2d& place, double depth_m) const;
};

struct ErrorMapOptions {
  int columns = 16;      ///< cells across camera 0's image; rows follow from its shape
  int planes = 5;        ///< number of planes, from the nearest to the farthest point of the boards
  double beyond = 0.15;  ///< margin in front of and behind them, m: as far as the prototype may be moved
};

/// One map for each projector: 95 % error (mm) of light meant for the middle of a target as large as the
/// board that faces camera 0 at that place, and whose pose camera 0 measures.
std::vector<ErrorMap> error_maps(const Observations& observations,
                                 const Solution& solution,
                                 const Uncertainty& uncertainty,
                                 const ErrorMapOptions& options = {});

}  // namespace limn::calib
