#pragma once

#include <filesystem>

#include "core/result.h"
#include "exchange/cad/progress_lines.h"
#include "exchange/curves/curve_list.h"

namespace limn::cad {

/// How curves become points.
struct CurveSampling {
  double chord_mm = 0.01;   ///< The largest distance between a curve and the lines between its points.
  bool with_edges = false;  ///< Also the edges of surfaces.
};

/// Reads the curves of a STEP or IGES file: a curve for each wire and each edge outside wires, at each place
/// of its product. Names are the curve's own, else its product's; a second curve of a name gets a number.
/// Errors: as read_document(); no curves; too many points.
Result<exchange::CurveList> read_curves(const std::filesystem::path& path,
                                        const CurveSampling& how,
                                        ProgressLines* progress);

}  // namespace limn::cad
