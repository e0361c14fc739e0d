#include "calib/judge/board_faults.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/judge/glued_sheets.h"
#include "core/log.h"

namespace limn::calib {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int k_least_views = 3;    // poses of a corner
constexpr double k_weak_m = 0.01;   // standard deviation of a weak prior on the offsets
constexpr double k_bend_m = 0.001;  // two parabolas describe bends below this; larger bends have other shapes
constexpr double k_bend_share = 0.003;    // share of the board's width; the same limit
constexpr double k_offset_m = 0.0003;     // RMS; where the board was used, light lands off by as much
constexpr double k_offset_share = 0.001;  // share of the board's width: office printers are accurate to 0.1 %

// Derivative of the pixel by the point in the board's frame.
std::optional<Eigen::Matrix<double, 2, 3>> by_point(const Imager& camera,
                                                    const Pose& world_from_board,
                                                    const Vector3d& p_board) {
  constexpr double k_step = 1e-5;  // m
  Eigen::Matrix<double, 2, 3> jacobian;
  const auto at = camera.project(world_from_board * p_board);
  for (int axis = 0; axis < 3; ++axis) {
    const auto moved = camera.project(world_from_board * (p_board + k_step * Vector3d::Unit(axis)));
    if (!at || !moved) return std::nullopt;
    jacobian.col(axis) = (*moved - *at) / k_step;
  }
  return jacobian;
}

struct CornerSums {
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  int views = 0;
};

std::vector<CornerSums> corner_sums(const Observations& observations, const Solution& solution) {
  const Board& board = observations.board;
  const BoardShape shape = board_shape(observations, solution);
  std::vector<CornerSums> sums(static_cast<size_t>(board.corner_count()));
  for (size_t i = 0; i < observations.corners.size(); ++i) {
    const CornerObservation& seen = observations.corners[i];
    const auto& world_from_board = solution.world_from_board[static_cast<size_t>(seen.pose)];
    const Vector2d& residual = solution.corner_residuals[i];
    if (!world_from_board || !residual.allFinite() || solution.corner_outlier[i]) continue;
    Vector3d p = board.p_corner(seen.corner);
    p.head<2>() = printed_corner(board, solution.print, seen.corner);
    p.z() = shape.z(solution.bend_m, p.x(), p.y());
    const auto jacobian =
        by_point(solution.rig.cameras[static_cast<size_t>(seen.camera)], *world_from_board, p);
    if (!jacobian) continue;
    CornerSums& sum = sums[static_cast<size_t>(seen.corner)];
    sum.normal += jacobian->transpose() * *jacobian;
    sum.right -= jacobian->transpose() * residual;  // predicted minus measured
    ++sum.views;
  }
  return sums;
}

// fy / fx - 1 that all imagers have in common: the smallest by size; 0 when signs or sizes differ.
double common_stretch(const Rig& rig) {
  double low = 1e9, high = -1e9;
  for (const auto* imagers : {&rig.cameras, &rig.projectors}) {
    for (const Imager& imager : *imagers) {
      const double stretch = imager.lens.fy() / imager.lens.fx() - 1;
      low = std::min(low, stretch);
      high = std::max(high, stretch);
    }
  }
  if (low * high <= 0 || high - low > std::min(std::abs(low), std::abs(high))) return 0;
  return std::abs(low) < std::abs(high) ? low : high;
}

// The errors of an uneven print are unknowns of the solve. Where its size was measured, nothing is left of
// them; else its scale is as uncertain as the print is uneven.
void note_print(const Board& board, const Solution& solution, std::vector<Fault>* faults) {
  constexpr double k_aspect = 4e-4, k_smooth_m = 0.05e-3;  // what prints on glass or aluminium keep
  const Vector2d growth = print_growth(board, solution.print);
  const double smooth = smooth_error_m(solution.print);
  if (std::abs(growth.x() - growth.y()) < k_aspect && smooth < k_smooth_m) return;
  faults->push_back(
      {FaultName::uneven_print,
       fmt::format(
           "the print's width and height differ from the board's text by {:+.2f} and {:+.2f} %, and its "
           "corners from that by {:.2f} mm RMS{}",
           100 * growth.x(), 100 * growth.y(), 1e3 * smooth,
           solution.print_is_measured ? "" : "; how large it is follows from no observation"),
       solution.print_is_measured
           ? "this is part of the solve; a board made on glass or aluminium needs no correction"
           : "measure from the first to the last inner corner, across and down, and give --board-measured; "
             "or use a "
             "board made on glass or aluminium",
       solution.print_is_measured ? Severity::note : Severity::doubt});
}

// Where each corner lies, as displacement from the board's text; NaN where too few poses show it.
std::vector<Vector2d> displacements(const Observations& observations,
                                    const Solution& solution,
                                    const BoardOffsets& offsets) {
  std::vector<Vector2d> all;
  for (int id = 0; id < observations.board.corner_count(); ++id) {
    const Vector3d& offset = offsets.offsets[static_cast<size_t>(id)];
    all.emplace_back(Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
    if (offset.isZero()) continue;
    all.back() = printed_corner(observations.board, solution.print, id) -
                 observations.board.p_corner(id).head<2>() + offset.head<2>();
  }
  return all;
}

Fault glued(const SheetStep& step) {
  return {
      FaultName::uneven_print,
      fmt::format(
          "the board seems to be glued from two sheets: from about its {} {} of inner corners on, all are "
          "displaced by {:.2f} mm across and {:.2f} mm down",
          step.is_between_columns ? "column" : "row", step.line + 1, 1e3 * step.offset_m.x(),
          1e3 * step.offset_m.y()),
      "print the board on one sheet, or glue the sheets again, edge to edge", Severity::doubt};
}

}  // namespace

BoardOffsets board_offsets(const Observations& observations, const Solution& solution) {
  BoardOffsets found;
  const double noise = std::max(solution.corner_scatter_px, 1e-3);
  double across = 0, out = 0;
  for (const CornerSums& sum : corner_sums(observations, solution)) {
    found.offsets.emplace_back(Vector3d::Zero());
    if (sum.views < k_least_views) continue;
    const Matrix3d covariance =
        (sum.normal / (noise * noise) + Matrix3d::Identity() / (k_weak_m * k_weak_m)).inverse();
    const Vector3d offset = covariance * sum.right / (noise * noise);
    found.offsets.back() = offset;
    across += offset.head<2>().squaredNorm() - covariance.topLeftCorner<2, 2>().trace();
    out += offset.z() * offset.z() - covariance(2, 2);
    ++found.corners;
  }
  if (found.corners == 0) return found;
  found.across_m = std::sqrt(std::max(0.0, across / found.corners));
  found.out_m = std::sqrt(std::max(0.0, out / found.corners));
  return found;
}

std::vector<Fault> board_faults(const Observations& observations, const Solution& solution) {
  std::vector<Fault> faults;
  const double width = observations.board.width_m();
  const double bend = std::max(solution.bend_m.cwiseAbs().maxCoeff(), std::abs(solution.twist_m));
  const BoardOffsets offsets = board_offsets(observations, solution);
  const double allowed = std::max(k_offset_m, k_offset_share * width);
  if (bend > std::max(k_bend_m, k_bend_share * width) || offsets.out_m > allowed)
    faults.push_back(
        {FaultName::board_not_flat,
         fmt::format(
             "the board differs from flat by {:.1f} mm over its width and height (bends of {:.1f} and {:.1f} "
             "mm, a twist of {:.1f} mm); its corners differ from that shape by {:.2f} mm RMS",
             1e3 * bend, 1e3 * solution.bend_m.x(), 1e3 * solution.bend_m.y(), 1e3 * solution.twist_m,
             1e3 * offsets.out_m),
         "glue the board onto glass, aluminium or honeycomb and hold it without pressing it"});
  if (const auto step = find_sheet_step(observations.board, displacements(observations, solution, offsets)))
    faults.push_back(glued(*step));
  else if (solution.print.size() > 0)
    note_print(observations.board, solution, &faults);
  const double stretch = common_stretch(solution.rig);
  const bool is_stretched = std::abs(stretch) > 0.01;
  if (is_stretched || (faults.empty() && offsets.across_m > allowed))
    faults.push_back(
        {FaultName::wrong_square_size,
         fmt::format("{}corners differ from their nominal positions by {:.2f} mm RMS",
                     is_stretched
                         ? fmt::format("all lenses have fy / fx = {:.3f}: squares are not as wide as "
                                       "high, or ",
                                       1 + stretch)
                         : "",
                     1e3 * offsets.across_m),
         "measure the printed squares across and down; print at 100 %, without fitting to the page; give "
         "--board or the plan the measured size"});
  return faults;
}

}  // namespace limn::calib
