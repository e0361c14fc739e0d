#pragma once

#include "core/result.h"
#include "validate/check_file.h"
#include "validate/check_result.h"

namespace limn::apps {

/// Draws what the check's limits ask for and measures it against the ray tracer; README.md says what each
/// measure compares with what. A GL context must be current. Error: nothing to judge by a measure, such as no
/// part in the image.
Result<CheckResult> judged(const Check& check);

}  // namespace limn::apps
