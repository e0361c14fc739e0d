#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "exchange/curves/named_curve.h"
#include "scene/files/cad_program.h"

namespace limn::scene {

/// The endings of files of curves, for messages: ".csv, .dxf, .step, ...".
const std::string& line_file_endings();

/// The curves of a file in the prototype's frame (m), by the ending of its name: CSV, DXF, or STEP and IGES
/// through limn-cad (points at most 0.01 mm beside the curve; a chain of edges that the file joins is one
/// curve). `with_edges`: of STEP and IGES also the edges of surfaces; otherwise only curves that bound none.
/// Names are the file's, with a number where several have the same ("line", "line 2"). Warnings about the
/// file are logged. Errors: another ending, a file of more than 64 MB, edges of CSV or DXF,
/// decode_csv_curves(), decode_dxf_curves(), run_limn_cad().
Result<std::vector<exchange::NamedCurve>> read_line_file(const std::filesystem::path& path,
                                                         bool with_edges = false);

/// Writes curves as CSV, DXF or STEP (AP242, in millimetres, through limn-cad; each is a product of its
/// name), by the ending of the file's name. The file is replaced only when it is complete. `form` and
/// `limits` are those of limn-cad. Errors: another ending, no curves, splines in CSV or DXF, for STEP
/// check_curve(), a file that cannot be written, those of run_limn_cad().
Status write_line_file(const std::vector<exchange::NamedCurve>& curves,
                       const std::filesystem::path& path,
                       exchange::CurveForm form = exchange::CurveForm::polyline,
                       const CadLimits& limits = {});

}  // namespace limn::scene
