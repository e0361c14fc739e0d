#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/surface/registration.h"
#include "core/result.h"

namespace limn::apps {

struct AlignOptions {
  std::filesystem::path scan;  ///< PLY, or the folder of limn scan; empty: the markers' answer alone
  std::string scan_units = "m";
  std::filesystem::path mesh;    ///< empty: the scene's prototype
  std::string units;             ///< of mesh
  std::filesystem::path start;   ///< POSES.json, or {"world_from_prototype": POSE}
  std::filesystem::path points;  ///< limn.picks/1
  std::filesystem::path scene;   ///< its prototype's markers give the start, in frames of a rig
  std::filesystem::path
      body;  ///< markers that stand anywhere on the thing (limn.body/1): where they are on the CAD
  std::filesystem::path rig;
  std::vector<std::string> frames;  ///< CAMERA=PICTURE, of the thing as it was scanned
  double least_mm = 1;              ///< smaller differences are not told
  std::filesystem::path out;
};

/// Where a mesh was found to stand.
struct MeshAligned {
  calib::Registration registration;
  std::string how;                    ///< what it started from
  std::vector<std::string> warnings;  ///< symmetric or free shapes, and where the CAD and the scan differ
};

/// Where a CAD mesh stands in the scan: poses.json (POSES.json), align.json with its covariance,
/// residual.ply, residual.png and residual-side.png, and warnings where the CAD and the scan differ. With a
/// body also markers.json (limn.markers/1), for a scene's prototype.markers. Without a start the whole scan
/// is searched. Everything is worked out before the first file is written.
Result<MeshAligned> written_alignment(const AlignOptions& command);

}  // namespace limn::apps
