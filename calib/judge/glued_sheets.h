#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/board/board.h"

namespace limn::calib {

/// Where a board's two parts are displaced against each other, as a board that was glued from two sheets is.
struct SheetStep {
  bool is_between_columns = false;  ///< otherwise between rows
  int line = 0;                     ///< the part begins with this column or row of corners, from 0
  Eigen::Vector2d offset_m = Eigen::Vector2d::Zero();  ///< the displacement of that part, board frame
};

/// Finds a step in the corners' displacements from their nominal places (m, one for each corner; NaN where
/// unknown): one of at least k_least_step_m without which smooth errors of a print explain them much worse.
std::optional<SheetStep> find_sheet_step(const Board& board,
                                         const std::vector<Eigen::Vector2d>& displacements);
constexpr double k_least_step_m = 0.15e-3;

}  // namespace limn::calib
