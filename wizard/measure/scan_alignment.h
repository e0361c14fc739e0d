#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/surface/registration.h"
#include "calib/surface/scan_overlap.h"
#include "calib/surface/scan_size.h"
#include "core/result.h"
#include "core/stage.h"
#include "scene/meshes/mesh.h"
#include "scene/meshes/mesh_bvh.h"
#include "scene/meshes/scan_surface.h"

namespace limn::wizard {

struct AlignOptions {
  std::filesystem::path scan;  ///< PLY, or the folder of limn scan; empty: the pose comes from markers
  scene::LengthUnit scan_units = scene::LengthUnit::metre;
  std::filesystem::path mesh;              ///< empty: the scene's prototype
  std::optional<scene::LengthUnit> units;  ///< units of the mesh; it needs them
  std::filesystem::path start;             ///< POSES.json, or {"world_from_prototype": POSE}
  std::filesystem::path points;            ///< limn.picks/1
  std::filesystem::path scene;             ///< its prototype's markers in `frames` give the start
  /// Markers anywhere on the scanned object (limn.body/1); their poses on the CAD are computed.
  std::filesystem::path body;
  std::filesystem::path rig;
  std::vector<std::string> frames;  ///< CAMERA=PICTURE, images of the object as it was scanned
  double least_mm = 1;              ///< smaller differences are not reported
  /// False: the start is the pose; it may state its covariance, as align.json does.
  bool is_aligned = true;
  double free_stddev_m = 1;  ///< as RegistrationOptions
  std::filesystem::path out;
  ReportStage report_stage = {};  ///< stages: read, align, compare, write
};

/// The result of an alignment.
struct MeshAligned {
  calib::Registration registration;
  calib::Overlap overlap;             ///< scan and mesh; zeros without a scan
  calib::ScanSize size = {};          ///< the scan's; a deviation of 0 where it could not be compared
  std::string how;                    ///< where the start came from
  std::vector<std::string> warnings;  ///< symmetry, undetermined directions, differences of CAD and scan
};

/// A CAD mesh, a scan, and the pose that was found.
struct ScanOnMesh {
  std::unique_ptr<const scene::Mesh> mesh;
  std::unique_ptr<const scene::MeshBvh> index;  ///< the mesh's
  scene::ScanSurface scan;
  std::filesystem::path file;  ///< the scan's PLY
  MeshAligned aligned;         ///< without the scan's size, and without warnings of free directions
};

/// The first part of align_scan(): reads both, aligns them and measures their overlap. It writes nothing and
/// does not judge the overlap. Needs a scan.
Result<ScanOnMesh> aligned_scan(const AlignOptions& options);

/// Measures the scan's size against the mesh's, and adds a warning where they contradict each other.
void measure_size(const scene::Mesh& mesh,
                  const scene::MeshBvh& index,
                  const scene::ScanSurface& scan,
                  MeshAligned* aligned);

/// Finds the pose of a CAD mesh in the scan and writes poses.json (which can be given as POSES.json),
/// align.json with the covariance, residual.ply, residual.png and residual-side.png; warns where the CAD and
/// the scan differ, and fails, with all files written, where they are hardly the same object. With a body it
/// also writes markers.json (limn.markers/1), for a scene's prototype.markers. Without a start the whole scan
/// is searched. The alignment is computed before the first file is written.
Result<MeshAligned> align_scan(const AlignOptions& command);

}  // namespace limn::wizard
