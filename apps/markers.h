#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct MarkersOptions {
  std::string family = "aruco_4x4_50";
  std::string ids = "0-11";     ///< such as 0-11,15; unused by a template file, which is one marker
  double size_mm = 40;          ///< side of the black square
  std::string board;            ///< instead of markers: charuco:11x8:25mm, chessboard:9x7:75mm
  std::filesystem::path train;  ///< instead: an image whose frame becomes the template `out`
  std::vector<std::filesystem::path> compare;  ///< instead: template files to tell apart
  std::filesystem::path json;                  ///< of the comparison; empty: none
  std::filesystem::path mount;  ///< also a holder for a marker (exchange/printing/marker_mount.h): .stl
  double paper_mm = 0.1;        ///< of the holder: thickness of paper and glue
  std::filesystem::path out;    ///< .pdf or .svg; a board also .png; a template .patt
};

/// Sheets to print on A4 at true size: black squares as vectors, white margin, name, a mark outside the
/// margin at each marker's top-left corner, a bar of 100 mm to check the printer. A board's page is as large
/// as the board. An SVG holds one page: further pages go to NAME-2.svg and so on. With `mount` alone, no
/// sheet.
Status run_markers(const MarkersOptions& options);

}  // namespace limn::apps
