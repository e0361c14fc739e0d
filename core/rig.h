#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/cameramodel.h"
#include "core/imager.h"
#include "core/imager_file.h"
#include "core/result.h"

namespace limn {

/// How a projector turns a display value into light, per channel: shares of full light (linear, 0 … 1) at
/// display values that are evenly spaced from 0 to 255. `response.json` (limn.response/1) of a rig folder.
struct Response {
  std::string projector;
  std::vector<double> red, green, blue;
};

/// Calibrated cameras and projectors in one world.
struct Rig {
  std::vector<Imager> cameras;
  std::vector<Imager> projectors;
  std::vector<Response> responses;
  /// Kept verbatim from and to rig.json; empty when absent. JSON texts.
  std::string covariance_json;
  std::string provenance_json;

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
