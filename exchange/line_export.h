#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "exchange/curves/named_curve.h"

namespace limn::exchange {

struct LineExportOptions {
  std::filesystem::path scene = {};  ///< Folder or its scene.json.
  std::filesystem::path out = {};    ///< .csv, .dxf, .step or .stp.
  std::string look = {};             ///< The lines of this look; empty: the scene's and all drawn ones.
  exchange::CurveForm form = exchange::CurveForm::polyline;  ///< What STEP has between the points.
  std::vector<std::string> lines = {};                       ///< Only these; empty: all that have curves.
  bool json = false;                                         ///< Print limn.lines/1.
};

/// `limn export lines`: writes the curves of a scene's lines (curves, texts, dimensions) and of lines that
/// were drawn in sessions (drawn.json, looks), as they lie on the surface, in the prototype's frame. A drawn
/// line that differs between looks is written for each, as "NAME (LOOK)". Section lines, patterns and
/// outlines are no curves and are left out, with a message. Errors: as load_scene() and write_line_file(); an
/// unknown line or look; no curves.
Status export_lines(const LineExportOptions& options);

}  // namespace limn::exchange
