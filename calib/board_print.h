#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "calib/board/board.h"
#include "core/result.h"

namespace limn::calib {

/// The size of a print, measured by hand: from its first to its last inner corner, across and down.
struct BoardMeasured {
  double width_m = 0;
  double height_m = 0;
  double stddev_m = 1e-4;  ///< standard deviation of each length
};

/// Reads "225.2x149.9mm:0.05": the two lengths and, behind a colon, their standard deviation in mm (0.1 when
/// absent). Errors: what was expected and what was found.
Result<BoardMeasured> parse_board_measured(const std::string& text);

/// Checks that the lengths are those of this board: within 1 % of its text. Errors: both numbers, and whether
/// the lengths seem to be swapped or in another unit.
Status check_measured(const Board& board, const BoardMeasured& measured);

/// How a print differs from the board's text, as parameters in metres: its width and height (0 and 1: by how
/// much an outer edge lies further from the middle), its shear (2), and smooth displacements (Legendre
/// polynomials of degree 2 to 4 of both coordinates, first those in x, then those in y; each has an RMS of 1
/// over the board). A displacement or rotation of the whole print is part of the board's pose.
constexpr int k_print_modes = 27;

/// Derivatives of a printed point's position by these parameters, at a point (x, y) of the board.
using PrintModes = Eigen::Matrix<double, 2, k_print_modes>;
PrintModes print_modes(const Board& board, const Eigen::Vector2d& p_board);

/// Where a corner is printed. An empty `print`: where the board's text has it.
Eigen::Vector2d printed_corner(const Board& board, const Eigen::VectorXd& print, int corner);

/// Prior standard deviations of the parameters: width and height within the share `size`, shear within
/// 0.0005, smooth errors of 0.1 mm RMS, as office printers have them.
constexpr double k_print_size = 0.003;
Eigen::Matrix<double, k_print_modes, 1> print_stddevs(const Board& board, double size = k_print_size);
/// By which share the print is wider (x) and higher (y) than the board's text.
Eigen::Vector2d print_growth(const Board& board, const Eigen::VectorXd& print);
/// RMS of the print's smooth errors, m, one coordinate.
double smooth_error_m(const Eigen::VectorXd& print);

/// By which share a print is larger than the board's text, the mean of its width and height, and the standard
/// deviation of that.
struct PrintGrowth {
  double mean = 0;
  double stddev = 0;
};
/// How much is known of it before anything is observed: of a print of which nothing, or `measured`, is known.
PrintGrowth expected_growth(const Board& board, const std::optional<BoardMeasured>& measured);

/// Derivatives of the two measured lengths by the parameters; the lengths are means over the rows and columns
/// of corners.
PrintModes by_print(const Board& board);
/// The two lengths by the board's text, m.
Eigen::Vector2d nominal_lengths(const Board& board);

}  // namespace limn::calib
