#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/cameramodel.h"
#include "core/imager.h"
#include "core/imager_file.h"
#include "core/response.h"
#include "core/result.h"

namespace limn {

/// Calibrated cameras and projectors in one world.
struct Rig {
  std::vector<Imager> cameras;
  std::vector<Imager> projectors;
  std::vector<Response> responses;  ///< of projectors; none where none was measured
  /// Kept verbatim from and to rig.json; empty when absent. JSON texts.
  std::string covariance_json;
  std::string provenance_json;
  std::vector<CameraResponse> camera_responses = {};  ///< none where none was measured

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
