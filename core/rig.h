#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/cameramodel.h"
#include "core/imager.h"
#include "core/photometric_response.h"
#include "core/result.h"

namespace limn {

/// How a projector's light blurs in front of and behind its plane of sharp focus: at depth z a point becomes
/// a disc of diameter aperture_m |1 - z / distance_m|.
struct Focus {
  std::string projector;
  double distance_m = 1;  ///< Depth of the sharp plane, along the lens's axis.
  double aperture_m = 0;  ///< Diameter of the exit pupil; 0: sharp everywhere.
};

/// Calibrated cameras and projectors in one world frame.
struct Rig {
  std::vector<Imager> cameras;
  std::vector<Imager> projectors;
  std::vector<ProjectorResponse> responses;  ///< Only for projectors whose response was measured.
  /// JSON texts, read from and written to rig.json unchanged; empty when absent.
  std::string covariance_json;
  std::string provenance_json;
  std::vector<CameraResponse> camera_responses = {};  ///< Only for cameras whose response was measured.
  std::vector<Focus> focuses = {};                    ///< Only for projectors whose focus is in rig.json.

  const Imager* find(const std::string& name) const;
  /// Index of the first camera that sees visible light: its images are shown to people and compared with
  /// projected light. 0 when all see infrared, or when there is none.
  std::size_t first_visible_camera() const;
};

/// Reads a rig folder: `rig.json` (limn.rig/1) and, if present, `response.json`. A folder without rig.json is
/// read from all `.cameramodel` files in it (names that start with "projector" are projectors). `path` may
/// also be the rig.json itself.
Result<Rig> load_rig(const std::filesystem::path& path);

/// Writes rig.json and one NAME.cameramodel per device; each file replaces its old version only when
/// complete.
Status save_rig(const Rig& rig, const std::filesystem::path& folder);

}  // namespace limn
