#pragma once

#include "core/result.h"
#include "wizard/measure/scan_alignment.h"

namespace limn::apps {

struct AlignCommand : wizard::AlignOptions {
  bool json = false;  ///< Prints align.json instead of a line.
};

/// `limn align`: calls align_scan() and prints the result.
Status run_align(const AlignCommand& command);

}  // namespace limn::apps
