#pragma once

#include <filesystem>

#include "core/result.h"
#include "exchange/cad/cad_model.h"
#include "exchange/cad/progress_lines.h"

namespace limn::cad {

/// Reads a STEP or IGES file: a mesh for each solid (or for the surfaces of a product that has no solids),
/// and a node for each place at which it stands. Surfaces that are hidden in the file are left out. Errors:
/// as read_document(); no surfaces; more triangles than `how` allows.
Result<CadModel> read_cad_model(const std::filesystem::path& path,
                                const Tessellation& how,
                                ProgressLines* progress);

}  // namespace limn::cad
