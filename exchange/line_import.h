#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>

#include "core/result.h"

namespace limn::exchange {

struct LineImportOptions {
  std::filesystem::path file = {};   ///< CSV, DXF, STEP or IGES, in the prototype's frame.
  std::filesystem::path scene = {};  ///< Folder or its scene.json, which is changed.
  std::string name = {};  ///< All curves become the line of this name; empty: a line for each name.
  bool edges = false;     ///< STEP and IGES: also the edges of surfaces.
  bool replace = false;   ///< Curves of lines that the scene has are replaced.
  std::optional<Eigen::Vector3d> colour = {};  ///< That new lines have, linear; absent: white.
  std::optional<double> width_mm = {};         ///< That new lines have, on the surface.
  bool json = false;                           ///< Print limn.lines/1.
};

/// `limn import lines`: adds a file's curves to `lines` of scene.json. The points of each line are kept as
/// lines/NAME.csv in the scene's folder, so that limn-cad is not needed again; of scene.json all else stays.
/// Nothing is changed unless all curves lie on the prototype. Errors: as read_line_file() and load_scene();
/// points farther than 20 mm from the prototype; a line that the scene has; too many lines; a folder that
/// cannot be written.
Status import_lines(const LineImportOptions& options);

}  // namespace limn::exchange
