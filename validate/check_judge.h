#pragma once

#include "core/result.h"
#include "validate/check_file.h"
#include "validate/check_result.h"

namespace limn::validate {

/// Draws what the check's limits need and compares it with the ray tracer; README.md says what each measure
/// compares. A GL context must be current. Error: a measure finds nothing to compare, such as no part in the
/// image.
Result<CheckResult> judge_check(const Check& check);

}  // namespace limn::validate
