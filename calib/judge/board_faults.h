#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/judge/faults.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// How the board differs from the one that the solve knows (flat but for two parabolas, square squares): for
/// each corner, from all poses that see it, its offset in the board's frame.
struct BoardOffsets {
  std::vector<Eigen::Vector3d> offsets;  ///< m, by corner id; zero where too few poses see it
  int corners = 0;                       ///< of them, known
  /// RMS over the known corners without what noise explains, m: across the sheet, out of it.
  double across_m = 0, out_m = 0;
};
BoardOffsets board_offsets(const Observations& observations, const Solution& solution);

/// bent_board: the solved bend or the offsets out of the sheet are more than a flat sheet's;
/// wrong_square_size: squares are wider than high (or the other way), by what cameras and projectors alike
/// would need as unequal focal lengths, or corners lie off their places.
std::vector<Fault> board_faults(const Observations& observations, const Solution& solution);

}  // namespace limn::calib
