#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// How a projector turns a display value into light, per channel: light share at `levels` display values that
/// are evenly spaced from 0 to 1. `response.json` of a rig folder.
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

/// Reads a rig folder: `rig.json` (limn.rig/1) and `response.json`, or, without a rig.json, every
/// `.cameramodel` in it (names that start with "projector" are projectors). `path` may name the rig.json itself.
Result<Rig> load_rig(const std::filesystem::path& path);

/// Writes rig.json and one NAME.cameramodel per device; each file replaces its predecessor only when complete.
Status save_rig(const Rig& rig, const std::filesystem::path& folder);

/// mrcal's text format. The imager's name is the file's stem.
Result<Imager> load_cameramodel(const std::filesystem::path& path);
Status save_cameramodel(const Imager& imager, const std::filesystem::path& path);

/// A single imager at the world's origin from a `.cameramodel`, an OpenCV camera YAML/XML (camera_matrix,
/// distortion_coefficients, image_width/height; without a size it is 0x0) or an ARToolKit `camera_para.dat`
/// (versions 4 and 5: OpenCV 4 or 12 parameter distortion; earlier ones: their radial model, refitted).
Result<Imager> load_imager(const std::filesystem::path& path);

}  // namespace limn
