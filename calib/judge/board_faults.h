#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/judge/faults.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// How the board differs from the model of the solve (flat except for two parabolas, square squares): for
/// each corner, from all poses that see it, its offset in the board's frame.
struct BoardOffsets {
  std::vector<Eigen::Vector3d> offsets;  ///< m, by corner id; zero where too few poses see it
  int corners = 0;                       ///< number of corners with a known offset
  /// RMS over the known corners without what noise explains, m: in the sheet's plane, and out of it.
  double across_m = 0, out_m = 0;
};
BoardOffsets board_offsets(const Observations& observations, const Solution& solution);

/// Detects:
/// - board_not_flat: the solved bend, or the offsets out of the sheet, are larger than a flat sheet's;
/// - wrong_square_size: squares are wider than high (or the reverse), because cameras and projectors alike
///   would need unequal focal lengths, or corners are not at their nominal positions.
std::vector<Fault> board_faults(const Observations& observations, const Solution& solution);

}  // namespace limn::calib
