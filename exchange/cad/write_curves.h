#pragma once

#include <filesystem>

#include "core/result.h"
#include "exchange/cad/progress_lines.h"
#include "exchange/curves/curve_list.h"

namespace limn::cad {

/// Writes curves as STEP AP242 in millimetres: each is a product with the curve's name and one B-spline
/// curve, cubic through the points (CurveForm::spline) or straight between them. The file is replaced only
/// when it is complete. Errors: points through which no spline goes; a file that cannot be written.
Status write_curves(const exchange::CurveList& list,
                    const std::filesystem::path& path,
                    ProgressLines* progress);

}  // namespace limn::cad
