#pragma once

#include "calib/report/report.h"
#include "core/result.h"
#include "wizard/measure/solve_captures.h"

namespace limn::wizard {

/// Solves cameras alone, from photographs of a board or from the white images of captures, and writes the rig
/// folder without projectors. `foreign.projector` is not needed; `foreign.board` is, unless the captures name
/// it.
Result<calib::Report> solve_cameras(const SolveCommandOptions& options);

}  // namespace limn::wizard
