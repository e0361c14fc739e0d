#pragma once

#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "calib/code/decode.h"
#include "calib/surface/range_view.h"
#include "calib/surface/tsdf_fusion.h"
#include "core/result.h"
#include "core/rig.h"
#include "core/stage.h"

namespace limn::calib {

struct ScanOptions {
  RangeOptions range;
  DecodeOptions decode;
  /// Names of the poses to use; empty: all without a visible board.
  std::vector<std::string> poses;
  /// The prototype stood in another place in every pose: each pose is registered to the first by its shape.
  /// `pieces` is then at least 1.
  bool moved = false;
  /// Keep this many of the largest connected pieces of each view, after the distance limits; 0: all.
  int pieces = 0;
  /// Voxel size of the mesh, m; 0: one and a half times the distance of neighbouring points.
  double voxel_m = 0;
  /// Smaller pieces of the mesh are removed, m².
  double least_area_m2 = 1e-4;
  ReportStage report_stage = {};  ///< stages: scan (a step for each view), merge
};

/// A view with its camera and pose, and where the pose was registered when the prototype moved.
struct ScanView {
  std::string camera, pose;
  RangeView view;
  Pose first_from_pose;  ///< already applied to the view's camera
};

/// The prototype's measured surface, in the rig's world (as in the first pose when it moved).
struct Scan {
  std::vector<ScanView> views;
  scene::ScanSurface points;
  scene::ScanSurface mesh;
  double voxel_m = 0;
  Agreement agreement;  ///< over all pairs of views that see the same surface
  std::vector<std::string> warnings;
  double seconds_decode = 0, seconds_range = 0, seconds_merge = 0;
};

/// Measures the surface from every scene pose of the captures. Errors: a camera or projector that the rig
/// lacks or that has another size there, no pose without a board, nothing measured, rays that do not meet
/// (another rig's captures), a prototype that moved between poses without the option `moved`.
Result<Scan> scan_captures(const CaptureSet& captures, const Rig& rig, const ScanOptions& options = {});

}  // namespace limn::calib
