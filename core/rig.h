#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/cameramodel.h"
#include "core/imager.h"
#include "core/imager_file.h"
#include "core/photometric_response.h"
#include "core/result.h"

namespace limn {

/// How a projector's light blurs before and behind its plane of sharp focus: at depth z a point of it is a
/// disc of diameter aperture_m |1 - z / distance_m|.
struct Focus {
  std::string projector;
  double distance_m = 1;  ///< depth of the sharp plane, along the lens's axis
  double aperture_m = 0;  ///< diameter of the exit pupil; 0: sharp everywhere
};

/// Calibrated cameras and projectors in one world.
struct Rig {
  std::vector<Imager> cameras;
  std::vector<Imager> projectors;
  std::vector<ProjectorResponse> responses;  ///< of projectors; none where none was measured
  /// Kept verbatim from and to rig.json; empty when absent. JSON texts.
  std::string covariance_json;
  std::string provenance_json;
  std::vector<CameraResponse> camera_responses = {};  ///< none where none was measured
  std::vector<Focus> focuses = {};                    ///< of projectors; none where nobody told it

  const Imager* find(const std::string& name) const;
};

/// Reads a rig folder: `rig.json` (limn.rig/1) and, where present, `response.json`, or, without a rig.json,
/// every
/// `.cameramodel` in it (names that start with "projector" are projectors). `path` may name the rig.json
/// itself.
Result<Rig> load_rig(const std::filesystem::path& path);

/// Writes rig.json and one NAME.cameramodel per device; each file replaces its predecessor only when
/// complete.
Status save_rig(const Rig& rig, const std::filesystem::path& folder);

}  // namespace limn
