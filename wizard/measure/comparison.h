#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/report/deviation_report.h"
#include "core/result.h"
#include "core/stage.h"
#include "scene/meshes/mesh_bvh.h"

namespace limn::wizard {

/// The standard deviation that is stated along directions that the shape does not determine, m: how far the
/// start may be off along them. Picked points, markers and the search are better than this.
inline constexpr double k_free_stddev_m = 5e-3;

/// A CAD mesh with its index, and a scan. Borrows all of them.
struct ScanBesideCad {
  const scene::Mesh& mesh;
  const scene::MeshBvh& index;
  const scene::ScanSurface& scan;
};

/// Fits again on the part of the scan inside the box (the CAD's frame, m), from where the whole scan lies: a
/// local best fit. Errors: no scan in the box, or too little.
Result<calib::Registration> fitted_in_box(const ScanBesideCad& both,
                                          const Eigen::AlignedBox3d& box,
                                          const Pose& world_from_prototype);

struct ComparisonOptions {
  double tolerance_m = 0.5e-3;
  double reach_m = 5e-3;
  double spacing_m = 0;  ///< 0: that of the scan
  /// The pose was given: its registration may state a metre along free directions, as limn align does. It
  /// then counts as k_free_stddev_m.
  bool is_given = false;
  ReportStage report_stage = {};  ///< Stages: sample, compare.
};

/// Compares the scan with the CAD at the registration's pose: calib::deviation with its summary, extremes and
/// warnings. The caller fills in where all came from. Errors: as calib::deviation.
Result<calib::DeviationReport> compared(const ScanBesideCad& both,
                                        const calib::Registration& registration,
                                        const ComparisonOptions& options);

/// Writes deviation.html, .json, .csv, .ply and poses.json, all of them or none.
Status write_deviation_files(const calib::DeviationReport& report, const std::filesystem::path& out);

}  // namespace limn::wizard
