#pragma once

#include <filesystem>

#include "core/result.h"

namespace limn::apps {

struct DemoOptions {
  std::filesystem::path out = "out";
  bool window = false;
  bool keep_captures = false;
};

/// `limn demo`: a whole session on the virtual rig `studio`: captures, calibration, markers found in a
/// simulated photograph, projector images drawn, projected and photographed in the simulator, all of it
/// compared with the simulator's ground truth. Writes images, demo.html and demo.json into `out` and prints
/// one table.
Status run_demo(const DemoOptions& options);

}  // namespace limn::apps
