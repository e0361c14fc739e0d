#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "wizard/measure/foreign_options.h"

namespace limn::apps {

struct ScanCommand {
  std::filesystem::path captures;  ///< Captures folder; empty with `plan`.
  std::filesystem::path
      plan;  ///< limn.plan/1: the prototype of its world is captured first, on the virtual rig.
  wizard::ForeignOptions foreign = {};  ///< Describes captures of another program.
  std::filesystem::path rig;
  std::filesystem::path out;
  std::vector<std::string> poses;  ///< Names; with `foreign` they are patterns of names.
  bool moved = false;
  int pieces = 0;
  double near_m = 0, far_m = 0;  ///< 0: no limit.
  double voxel_mm = 0;           ///< 0: 1.5 times the distance between points.
  int smooth_px = 3;
  bool json = false;
};

/// `limn scan`: loads captures of the scene and a calibrated rig for make_scan().
Status run_scan(const ScanCommand& command);

}  // namespace limn::apps
