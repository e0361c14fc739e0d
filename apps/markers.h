#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct MarkersOptions {
  std::string family = "aruco_4x4_50";
  std::string ids = "0-11";     ///< Such as 0-11,15; unused by a template file, which is one marker.
  double size_mm = 40;          ///< Side of the marker's square.
  std::string board;            ///< Instead of markers: charuco:11x8:25mm, aprilgrid:6x6:88mm:0.3 …
  std::filesystem::path train;  ///< Instead: an image whose black frame becomes the template `out`.
  double pattern_ratio = 0.5;   ///< For `train`: width of the frame's inside as share of the frame's.
  std::vector<std::filesystem::path> compare;  ///< Instead: template files to compare.
  std::filesystem::path json;                  ///< Report of the comparison; empty: none.
  std::filesystem::path mount;  ///< Also a holder for a marker, .stl (exchange/printing/marker_mount.h).
  double paper_mm = 0.1;        ///< For the holder: thickness of paper and glue.
  std::filesystem::path out;    ///< .pdf or .svg; for a board also .png; for a template .patt.
};

/// Writes sheets to print on A4 at true size: black squares as vectors, a white margin, the name, a mark
/// outside the margin at each marker's top-left corner, and a bar of 100 mm to check the printer. A board's
/// page is as large as the board. An SVG holds one page: further pages go to NAME-2.svg and so on. With
/// `mount` alone no sheet is written.
Status run_markers(const MarkersOptions& options);

}  // namespace limn::apps
