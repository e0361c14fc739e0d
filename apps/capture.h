#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct CaptureOptions {
  std::filesystem::path plan;
  std::filesystem::path out;
};

/// `limn capture`: shows the patterns and takes the images of every pose of a plan, on its virtual rig.
Status run_capture(const CaptureOptions& options);

}  // namespace limn::apps
