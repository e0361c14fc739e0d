#pragma once

// The errors of an office printer, for tests and benches.

#include <Eigen/Core>
#include <cmath>
#include <numbers>

#include "calib/board/board.h"
#include "calib/measurement_model.h"
#include "tests/calib/true_rig.h"

namespace limn::test {

// A print that is 0.15 % wider than it is high, with smooth errors of 0.1 mm (waves, which no polynomial of
// the solve is), on a board that is bowed and twisted.
struct BadPrint {
  double aspect = 0.0015, smooth_m = 0.1e-3;
  double phase = 0.7;
  double step_m = 0;  // displacement of the right half, to the right

  Eigen::Vector2d at(const calib::Board& board, const Eigen::Vector2d& p) const {
    const double x = p.x() / board.width_m(), y = p.y() / board.height_m(), tau = 2 * std::numbers::pi;
    return {p.x() * (1 + aspect) + (x > 0.5 ? step_m : 0) +
                smooth_m * std::sin(tau * (0.7 * x + 0.5 * y) + phase),
            p.y() + smooth_m * std::cos(tau * (0.4 * x - 0.7 * y) + 2 * phase)};
  }
  // From the first to the last inner corner, as means over rows and columns.
  Eigen::Vector2d lengths(const calib::Board& board) const {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    const int columns = board.columns - 1, rows = board.rows - 1;
    const auto corner = [&](int column, int row) {
      return at(board, board.p_corner(row * columns + column).head<2>());
    };
    for (int row = 0; row < rows; ++row) sum.x() += (corner(columns - 1, row) - corner(0, row)).x() / rows;
    for (int column = 0; column < columns; ++column)
      sum.y() += (corner(column, rows - 1) - corner(column, 0)).y() / columns;
    return sum;
  }
};

// Moves the observed corners to where they are on this print.
inline void print_corners(const TrueRig& truth, const BadPrint& print, calib::Observations* observations) {
  const calib::Board& board = truth.board;
  for (calib::CornerObservation& seen : observations->corners) {
    const Imager& camera = truth.rig.cameras[static_cast<size_t>(seen.camera)];
    calib::predict_corner({camera.lens.model, camera.lens.values, camera.imager_from_world},
                          truth.world_from_board[static_cast<size_t>(seen.pose)],
                          {board.width_m(), board.height_m(), truth.twist_m}, truth.bow_m,
                          print.at(board, board.p_corner(seen.corner).head<2>()), &seen.px);
  }
}

}  // namespace limn::test
