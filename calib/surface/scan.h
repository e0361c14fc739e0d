#pragma once

#include <string>
#include <vector>

#include "calib/capture_set.h"
#include "calib/code/decode.h"
#include "calib/surface/tsdf_fusion.h"
#include "calib/surface/range_view.h"
#include "core/result.h"
#include "core/rig.h"

namespace limn::calib {

struct ScanOptions {
  RangeOptions range;
  DecodeOptions decode;
  /// Names of the poses to use; empty: all without a visible board.
  std::vector<std::string> poses;
  /// The prototype stood elsewhere in every pose: each is laid onto the first by its shape. `pieces` is then
  /// 1 unless it is more.
  bool moved = false;
  /// Keep that many of the largest connected pieces of each view, after the distance limits; 0: all.
  int pieces = 0;
  /// Of the mesh, m; 0: one and a half times the distance of neighbouring points.
  double voxel_m = 0;
  /// Smaller pieces of the mesh are dropped.
  double least_area_m2 = 1e-4;
};

/// Which camera and pose a view is of, and where the pose was laid when the prototype moved.
struct ScanView {
  std::string camera, pose;
  RangeView view;
  Pose first_from_pose;  ///< the view's camera has been carried along
};

/// What the captures say of the prototype's surface, in the rig's world (of the first pose when it moved).
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
/// lacks or that has another size there, no pose without a board, nothing seen, rays that pass each other
/// (another rig's captures), a prototype that moved between poses when `moved` is not said.
Result<Scan> scan_captures(const CaptureSet& captures, const Rig& rig, const ScanOptions& options = {});

}  // namespace limn::calib
