#include "calib/board_print.h"

#include <array>
#include <cmath>
#include <cstdlib>
#include <regex>

namespace limn::calib {
namespace {

using Eigen::Vector2d;

constexpr int k_least_degree = 2, k_most_degree = 4;
constexpr double k_shear = 0.0005;
// Standard deviation of a polynomial of degree 2, 3 and 4: together 0.1 mm in each coordinate.
constexpr std::array k_smooth_m = {0.04e-3, 0.03e-3, 0.02e-3};

double legendre(int degree, double x) {
  switch (degree) {
    case 0:
      return 1;
    case 1:
      return x;
    case 2:
      return (3 * x * x - 1) / 2;
    case 3:
      return (5 * x * x - 3) * x / 2;
    default:
      return ((35 * x * x - 30) * x * x + 3) / 8;
  }
}

Vector2d relative(const Board& board, const Vector2d& p_board) {
  return {2 * p_board.x() / board.width_m() - 1, 2 * p_board.y() / board.height_m() - 1};
}

constexpr double k_contradicts = 0.01;  // prints are wrong by some thousandths, other boards by more
constexpr double k_most_stddev_mm = 5;

bool agree(const Vector2d& a, const Vector2d& b) {
  return ((a - b).array().abs() < k_contradicts * b.array()).all();
}

// What the operator may have done when the lengths are not the board's.
std::string likely_reason(const Vector2d& nominal, const Vector2d& found) {
  if (agree({found.y(), found.x()}, nominal)) return "They seem to be swapped: give the width first.";
  constexpr std::pair<double, const char*> k_units[] = {{10, "cm"}, {25.4, "inches"}, {1000, "m"}};
  for (const auto& [factor, unit] : k_units) {
    if (agree(factor * found, nominal))
      return std::string("They seem to be in ") + unit + ": give them in mm.";
  }
  return "Measure from the first to the last inner corner, across and down; or the board's text is wrong, or "
         "this is "
         "another board.";
}

}  // namespace

Result<BoardMeasured> parse_board_measured(const std::string& text) {
  static const std::regex k_form(R"((\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)mm(?::(\d+(?:\.\d+)?)(?:mm)?)?)");
  std::smatch parts;
  if (!std::regex_match(text, parts, k_form) || text.size() > 40)
    return error(
        "board's measured size '{}': expected WIDTHxHEIGHTmm, from the first to the last inner corner, with "
        "their "
        "uncertainty in mm behind a colon if it is not 0.1, such as 225.2x149.9mm:0.05.",
        text);
  const auto number = [&](size_t i) { return std::strtod(parts[i].str().c_str(), nullptr); };
  const double stddev_mm = parts[3].matched ? number(3) : 0.1;
  if (!(number(1) > 0) || !(number(2) > 0) || !(stddev_mm > 0) || stddev_mm > k_most_stddev_mm)
    return error(
        "board's measured size '{}': expected lengths above 0 and an uncertainty above 0, at most {} mm.",
        text, k_most_stddev_mm);
  return BoardMeasured{1e-3 * number(1), 1e-3 * number(2), 1e-3 * stddev_mm};
}

Status check_measured(const Board& board, const BoardMeasured& measured) {
  if (board.is_exact)
    return error(
        "board's measured size: expected none for {}, whose text says that it is exact. Leave the measured "
        "size "
        "or ':exact' out.",
        board.text());
  const Vector2d nominal = nominal_lengths(board), found(measured.width_m, measured.height_m);
  if (agree(found, nominal)) return {};
  return error(
      "board's measured size: expected about {:.2f} x {:.2f} mm for {}, found {:.2f} x {:.2f} mm. {}",
      1e3 * nominal.x(), 1e3 * nominal.y(), board.text(), 1e3 * found.x(), 1e3 * found.y(),
      likely_reason(nominal, found));
}

PrintModes print_modes(const Board& board, const Vector2d& p_board) {
  const Vector2d r = relative(board, p_board);
  PrintModes modes = PrintModes::Zero();
  modes(0, 0) = r.x();
  modes(1, 1) = r.y();
  modes(0, 2) = r.y();
  constexpr int k_smooth = (k_print_modes - 3) / 2;
  int at = 3;
  for (int degree = k_least_degree; degree <= k_most_degree; ++degree) {
    for (int across = degree; across >= 0; --across, ++at) {
      const int down = degree - across;
      modes(0, at) =
          std::sqrt((2 * across + 1) * (2 * down + 1)) * legendre(across, r.x()) * legendre(down, r.y());
      modes(1, at + k_smooth) = modes(0, at);
    }
  }
  return modes;
}

Vector2d printed_corner(const Board& board, const Eigen::VectorXd& print, int corner) {
  const Vector2d p = board.p_corner(corner).head<2>();
  if (print.size() == 0) return p;
  return p + print_modes(board, p) * print;
}

Eigen::Matrix<double, k_print_modes, 1> print_stddevs(const Board& board, double size) {
  Eigen::Matrix<double, k_print_modes, 1> stddevs;
  stddevs[0] = size * board.width_m() / 2;
  stddevs[1] = size * board.height_m() / 2;
  stddevs[2] = k_shear * board.height_m() / 2;
  int at = 3;
  for (int axis = 0; axis < 2; ++axis) {
    for (int degree = k_least_degree; degree <= k_most_degree; ++degree) {
      for (int i = 0; i <= degree; ++i)
        stddevs[at++] = k_smooth_m[static_cast<size_t>(degree - k_least_degree)];
    }
  }
  return stddevs;
}

Vector2d print_growth(const Board& board, const Eigen::VectorXd& print) {
  return {2 * print[0] / board.width_m(), 2 * print[1] / board.height_m()};
}

PrintGrowth expected_growth(const Board& board, const std::optional<BoardMeasured>& measured) {
  if (board.is_exact) return {};
  if (!measured) return {0, k_print_size / std::sqrt(2.0)};
  const Vector2d nominal = nominal_lengths(board);
  return {(measured->width_m / nominal.x() + measured->height_m / nominal.y()) / 2 - 1,
          measured->stddev_m * nominal.cwiseInverse().norm() / 2};
}

double smooth_error_m(const Eigen::VectorXd& print) {
  return print.tail(print.size() - 3).norm() / std::sqrt(2.0);
}

PrintModes by_print(const Board& board) {
  PrintModes lengths = PrintModes::Zero();
  const int columns = board.columns - 1, rows = board.rows - 1;
  const auto modes = [&](int column, int row) {
    return print_modes(board, board.p_corner(row * columns + column).head<2>());
  };
  for (int row = 0; row < rows; ++row)
    lengths.row(0) += (modes(columns - 1, row).row(0) - modes(0, row).row(0)) / rows;
  for (int column = 0; column < columns; ++column)
    lengths.row(1) += (modes(column, rows - 1).row(1) - modes(column, 0).row(1)) / columns;
  return lengths;
}

Vector2d nominal_lengths(const Board& board) {
  return (board.p_corner(board.corner_count() - 1) - board.p_corner(0)).head<2>();
}

}  // namespace limn::calib
