#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/captures.h"
#include "calib/surface/scan.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::apps {

struct ScanCommand {
  std::filesystem::path captures;  ///< captures folder; with `plan` its pictures are taken first
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

/// Measures the surface as calib::scanned does and writes points.ply, mesh.ply (metres, the rig's world),
/// scan.json and pictures into `out`. Everything is measured before the first file is written.
Result<calib::Scan> written_scan(const calib::Captures& captures,
                                 const Rig& rig,
                                 const calib::ScanOptions& options,
                                 const std::filesystem::path& out);

/// `limn scan`: scene captures and a calibrated rig to written_scan.
Status run_scan(const ScanCommand& command);

}  // namespace limn::apps
