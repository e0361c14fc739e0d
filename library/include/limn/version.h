#pragma once

#include "limn/export.h"

/// The version of these headers. 0.y promises: 0.y.z and 0.y.w can replace each other without compiling
/// again; 0.y+1 may change names, types and results, each with a line in CHANGELOG.md that says what to write
/// instead.
#define LIMN_VERSION_MAJOR 0
#define LIMN_VERSION_MINOR 1
#define LIMN_VERSION_PATCH 0
#define LIMN_VERSION_TEXT "0.1.0"

namespace limn::LIMN_VERSIONED {
/// The version of the library that runs, "X.Y.Z".
LIMN_API const char* version();

}  // namespace limn::LIMN_VERSIONED
