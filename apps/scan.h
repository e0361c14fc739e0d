#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::apps {

struct ScanCommand {
  std::filesystem::path captures;  ///< captures folder; with `plan` its images are taken first
  std::filesystem::path plan;      ///< limn.plan/1: the prototype of its world is captured on the virtual rig
  std::filesystem::path rig;
  std::filesystem::path out;
  std::vector<std::string> poses;
  bool moved = false;
  int pieces = 0;
  double near_m = 0, far_m = 0;  ///< 0: no limit
  double voxel_mm = 0;           ///< 0: from the points' distance
  int smooth_px = 3;
  bool json = false;
};

/// `limn scan`: scene captures and a calibrated rig to written_scan.
Status run_scan(const ScanCommand& command);

}  // namespace limn::apps
