#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>

#include "calib/report/deviation_report.h"
#include "core/result.h"
#include "wizard/measure/scan_alignment.h"

namespace limn::wizard {

struct DeviationFilesOptions {
  /// The scan, the CAD and where the alignment starts. Stages: read, align, sample, compare, write.
  AlignOptions align;
  /// The alignment is refined on the scan inside this box of the CAD's frame (m): a local best fit.
  std::optional<Eigen::AlignedBox3d> fit_box;
  double tolerance_m = 0.5e-3;
  double reach_m = 5e-3;
  double spacing_m = 0;  ///< 0: that of the scan
};

/// Aligns the scan with the CAD, compares them (calib::deviation) and writes deviation.html, .json, .csv,
/// .ply and poses.json into `align.out`, all of them or none. Errors: as align_scan; a scan that hardly
/// overlaps the CAD; a box without scan points.
Result<calib::DeviationReport> write_deviation(const DeviationFilesOptions& options);

}  // namespace limn::wizard
