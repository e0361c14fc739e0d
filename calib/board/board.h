#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::calib {

enum class BoardKind { charuco, chessboard, aprilgrid, circles, asymmetric_circles };

/// A flat calibration target. Board frame: origin at the outer corner of the top-left square (the grid's
/// corner, not the sheet's), x right, y down, z into the sheet; metres. The top-left square is black; on a
/// ChArUco board every white square carries a marker, ids counted row by row from 0. Kalibr's AprilGrid is
/// such a grid, too: its columns and rows are by turns narrow and wide, its wide black squares are tags of
/// apriltag_36h11 in borders of two cells, its narrow ones the squares that touch their corners. Tag 0 is the
/// one at the bottom left, and ids go to the right, then up; tags stand as AprilTag's own library draws them.
///
/// Text form, as in docs/formats.md:
///   `charuco:11x8:25mm`                        11 x 8 squares of 25 mm
///   `charuco:11x8:25mm:aruco_5x5_100:0.7`      with its dictionary and the marker's side as a share of the
///                                              square's
///   `chessboard:9x7:75mm`                      9 x 7 INNER corners, that is 10 x 8 squares
///   `aprilgrid:6x6:88mm:0.3`                   6 x 6 tags of 88 mm, 0.3 x 88 mm apart (Kalibr's tagSpacing)
///   `circles:11x7:20mm`                        11 x 7 black circles, 20 mm from centre to centre
///   `acircles:4x11:20mm`                       OpenCV's asymmetric grid: 11 rows of 4 circles, 20 mm apart;
///                                              circles of a row are 40 mm apart, every second row is shifted
/// `:exact` behind each of these names a target without errors (glass, aluminium, measured): its squares are
/// as large as the text says, and no error of a print is looked for.
/// A circle grid's corners are the centres of its circles; its outermost ones lie one spacing from the
/// board's origin and edges. The circles' radius is measured in the images. Defaults: the smallest aruco_4x4
/// dictionary that has enough markers; 0.75 (whole cells: 8 to a square).
struct Board {
  BoardKind kind = BoardKind::charuco;
  int columns = 0;          ///< squares across; circle grids: one more than circles in a row
  int rows = 0;             ///< squares down; circle grids: one more than rows
  double square_m = 0;      ///< AprilGrid: the side of a tag
  double gap_share = 0;     ///< AprilGrid: the narrow squares' side / the tags'
  std::string dictionary;   ///< ChArUco: OpenCV's predefined dictionary, `aruco_4x4_50`
  double marker_share = 0;  ///< ChArUco: the marker's side / the square's side
  bool is_exact = false;    ///< whether it is known to be as its text says

  static Result<Board> parse(const std::string& text);
  std::string text() const;

  /// Inner corners, where four squares meet: id = row * (columns - 1) + column, from the top left.
  int corner_count() const { return (columns - 1) * (rows - 1); }
  /// Position of a corner on the flat board (z = 0).
  Eigen::Vector3d p_corner(int id) const;
  /// Distance of a line of the grid from the board's first one, across or down; line i lies between squares
  /// i - 1 and i.
  double p_line(int line) const {
    if (kind != BoardKind::aprilgrid) return line * square_m;
    const int pairs = line / 2;
    return (pairs * (1 + gap_share) + line % 2 * gap_share) * square_m;
  }
  double width_m() const { return p_line(is_shifted() ? 2 * columns - 1 : columns); }
  double height_m() const { return p_line(rows); }
  bool is_circles() const { return kind == BoardKind::circles || is_shifted(); }
  /// Whether every second row is shifted.
  bool is_shifted() const { return kind == BoardKind::asymmetric_circles; }
  /// Whether the board looks the same when it is turned by 180 degrees.
  bool is_ambiguous() const;
  bool is_black(int column, int row) const { return (column + row) % 2 == 0; }
};

/// The whole sheet as an exact image: every square and every marker cell is a whole number of pixels; the
/// edges of circles are grey where they cross a pixel.
struct BoardSheet {
  cv::Mat image;                ///< 8-bit grey: 0 black ink, 255 paper
  double pixels_per_metre = 0;  ///< for pHYs (the resolution in a PNG) and for texturing a plane
  /// Pixel coordinates (pixel centres at integers) of the board frame's origin. They end in .5, because the
  /// origin lies on a pixel's edge: px = px_board_origin + pixels_per_metre * p_board.xy
  Eigen::Vector2d px_board_origin = Eigen::Vector2d::Zero();
};

struct DrawOptions {
  int square_px = 80;  ///< minimum; the next size with whole marker cells is used
  int margin_px = -1;  ///< white border around the grid; -1: as wide as a square
};
BoardSheet draw_board(const Board& board, const DrawOptions& options = {});

}  // namespace limn::calib
