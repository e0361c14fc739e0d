#pragma once

#include <filesystem>

#include "calib/capture_set.h"
#include "calib/surface/scan.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::wizard {

/// Measures the surface with calib::scan_captures and writes points.ply, mesh.ply (metres, the rig's world),
/// scan.json and images into `out`. Everything is measured before the first file is written.
/// Its stages are those of scan_captures and `write`.
Result<calib::Scan> make_scan(const calib::CaptureSet& captures,
                              const Rig& rig,
                              const calib::ScanOptions& options,
                              const std::filesystem::path& out);

/// The quantile `share` (0 to 1) of the points' standard deviations, mm; 0 without points.
double stddev_mm(const calib::Scan& scan, double share);

}  // namespace limn::wizard
