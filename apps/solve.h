#pragma once

#include "core/result.h"
#include "wizard/measure/solve_captures.h"

namespace limn::apps {

/// `limn solve`: calls solve_captures() and prints a table. `is_json`: prints report.json instead.
Status run_solve(const wizard::SolveCommandOptions& options, bool is_json = false);

}  // namespace limn::apps
