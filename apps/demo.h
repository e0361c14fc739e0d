#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct DemoOptions {
  std::filesystem::path out = "out";
  bool window = false;
  bool keep_captures = false;
};

/// `limn demo`: a whole session on the virtual rig `studio`, from nothing to a lit door: captures,
/// calibration, markers found in a simulated photograph, projector images drawn, shone and photographed in
/// the simulator, and all of it judged against the simulator's truth. Writes images, demo.html and demo.json
/// into `out`, prints one table.
Status run_demo(const DemoOptions& options);

}  // namespace limn::apps
