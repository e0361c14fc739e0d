#pragma once

#include <filesystem>
#include <string>

#include "core/result.h"

namespace limn::exchange {

struct MarkerSheetOptions {
  std::string family;         ///< Such as aruco_4x4_50; artoolkit:FILE is one marker.
  std::string ids;            ///< Such as 0-11,15; unused by a template file.
  double size_mm = 40;        ///< Side of the marker's square.
  std::filesystem::path out;  ///< .pdf or .svg
};

struct MarkerSheet {
  int markers = 0, pages = 0;
};

/// Writes sheets to print on A4 at true size: markers as vectors, a white margin, the name, a mark
/// outside the margin at each marker's top-left corner, and a bar of 100 mm to check the printer. An SVG
/// holds one page: further pages go to NAME-2.svg and so on.
Result<MarkerSheet> write_marker_sheet(const MarkerSheetOptions& options);

/// Writes a calibration board (calib/board/board.h) on a page as large as the board, into
/// a .pdf, .svg or .png. Returns the board's text.
Result<std::string> write_board_sheet(const std::string& board, const std::filesystem::path& out);

/// The white margin around a marker whose square has this side.
double margin_mm(double size_mm);

/// How far the markers of the sheet reach beyond their squares (core/marker_drawing.h).
Result<double> around_mm(const MarkerSheetOptions& options);

}  // namespace limn::exchange
