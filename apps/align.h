#pragma once

#include "core/result.h"
#include "wizard/measure/scan_alignment.h"

namespace limn::apps {

struct AlignCommand : AlignOptions {
  bool json = false;  ///< print align.json instead of a line
};

/// `limn align`: as written_alignment(), and prints what came of it.
Status run_align(const AlignCommand& command);

}  // namespace limn::apps
