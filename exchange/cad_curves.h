#pragma once

#include <filesystem>
#include <span>
#include <stop_token>
#include <vector>

#include "core/result.h"
#include "exchange/curves/named_curve.h"
#include "scene/files/cad_program.h"

namespace limn::exchange {

/// How the curves of a CAD file become points.
struct CurveReading {
  double chord_mm =
      0.01;  ///< The largest distance between a curve and the straight lines between its points.
  bool with_edges = false;  ///< Also the edges of surfaces; otherwise only curves that bound none.
  scene::CadLimits limits = {};
};

/// Reads the curves of a STEP or IGES file with limn-cad, in the order of the file. A chain of edges that the
/// file joins to a wire is one curve. Names are the file's: the curve's own, else its product's, with a
/// number where several have the same ("line", "line 2"). Units are the file's. Errors: as run_limn_cad() of
/// scene/files/cad_program.h; a file without curves.
Result<std::vector<NamedCurve>> read_cad_curves(const std::filesystem::path& file,
                                                const CurveReading& options = {},
                                                const std::stop_token& stop = {});

/// Writes curves as STEP (AP242, in millimetres) with limn-cad: each is a product of its name. The file is
/// replaced only when it is complete. Errors: as run_limn_cad(); no curves; a curve of fewer than two points
/// or with a point that is not finite.
Status write_step_curves(std::span<const NamedCurve> curves,
                         const std::filesystem::path& file,
                         CurveForm form = CurveForm::polyline,
                         const scene::CadLimits& limits = {},
                         const std::stop_token& stop = {});

}  // namespace limn::exchange
