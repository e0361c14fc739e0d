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
/// through limn-cad. Warnings about the file are logged. Errors: another ending, a file of more than 64 MB,
/// decode_csv_curves(), decode_dxf_curves(), run_limn_cad().
Result<std::vector<exchange::NamedCurve>> read_line_file(const std::filesystem::path& path);

/// Writes curves as CSV, DXF or STEP (through limn-cad), by the ending of the file's name. The file is
/// replaced only when it is complete. `limits` are those of limn-cad. Errors: another ending, no curves, a
/// file that cannot be written, those of run_limn_cad().
Status write_line_file(const std::vector<exchange::NamedCurve>& curves,
                       const std::filesystem::path& path,
                       const CadLimits& limits = {});

}  // namespace limn::scene
