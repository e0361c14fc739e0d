#include "calib/judge/glued_sheets.h"

#include <Eigen/Dense>
#include <cmath>

#include "calib/board_print.h"

namespace limn::calib {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr int k_affine = 6;
constexpr double k_better = 0.5;     // share of the smooth model's sum of squares
constexpr std::size_t k_spare = 10;  // more corners than unknowns of a coordinate

// The corners that are known, and their displacements as one vector (x and y by turns).
struct Known {
  std::vector<int> corners;
  VectorXd displaced;
};

Known known_corners(const std::vector<Vector2d>& displacements) {
  Known all;
  for (std::size_t i = 0; i < displacements.size(); ++i) {
    if (displacements[i].allFinite()) all.corners.push_back(static_cast<int>(i));
  }
  all.displaced.resize(2 * static_cast<Eigen::Index>(all.corners.size()));
  for (std::size_t i = 0; i < all.corners.size(); ++i)
    all.displaced.segment<2>(2 * static_cast<Eigen::Index>(i)) =
        displacements[static_cast<std::size_t>(all.corners[i])];
  return all;
}

// Rows of an affine displacement and a print's smooth errors, and room for `more` further columns.
constexpr Eigen::Index k_smooth = k_affine + k_print_modes;
MatrixXd smooth_rows(const Board& board, const Known& all, Eigen::Index more) {
  MatrixXd rows = MatrixXd::Zero(all.displaced.size(), k_smooth + more);
  for (std::size_t i = 0; i < all.corners.size(); ++i) {
    const Vector2d p = board.p_corner(all.corners[i]).head<2>();
    const auto at = 2 * static_cast<Eigen::Index>(i);
    for (Eigen::Index axis = 0; axis < 2; ++axis)
      rows.block<1, 3>(at + axis, 3 * axis) << 1, p.x() / board.width_m(), p.y() / board.width_m();
    rows.block<2, k_print_modes>(at, k_affine) = print_modes(board, p);
  }
  return rows;
}

struct StepFit {
  VectorXd values;
  double squares = 0;
};

StepFit fit_rows(const MatrixXd& rows, const VectorXd& displaced) {
  StepFit fit{rows.colPivHouseholderQr().solve(displaced), 0};
  fit.squares = (rows * fit.values - displaced).squaredNorm();
  return fit;
}

StepFit fit_step(const Board& board, const Known& all, bool is_between_columns, int line) {
  MatrixXd rows = smooth_rows(board, all, 2);
  const int columns = board.columns - 1;
  for (std::size_t i = 0; i < all.corners.size(); ++i) {
    const int at = is_between_columns ? all.corners[i] % columns : all.corners[i] / columns;
    if (at >= line)
      rows.block<2, 2>(2 * static_cast<Eigen::Index>(i), k_smooth) = Eigen::Matrix2d::Identity();
  }
  return fit_rows(rows, all.displaced);
}

}  // namespace

std::optional<SheetStep> find_sheet_step(const Board& board, const std::vector<Vector2d>& displacements) {
  const Known all = known_corners(displacements);
  if (all.corners.size() < (k_affine + k_print_modes) / 2 + k_spare) return std::nullopt;
  double least = k_better * fit_rows(smooth_rows(board, all, 0), all.displaced).squares;
  std::optional<SheetStep> found;
  for (const bool is_between_columns : {true, false}) {
    const int lines = (is_between_columns ? board.columns : board.rows) - 1;
    for (int line = 1; line < lines; ++line) {
      const StepFit step = fit_step(board, all, is_between_columns, line);
      const Vector2d offset = step.values.tail<2>();
      if (step.squares >= least || offset.norm() < k_least_step_m) continue;
      least = step.squares;
      found = {is_between_columns, line, offset};
    }
  }
  return found;
}

}  // namespace limn::calib
