#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "scene/meshes/mesh.h"

namespace limn::apps {

struct ImportRigOptions {
  std::vector<std::filesystem::path> files;  ///< One, or two that belong together.
  std::filesystem::path out;                 ///< Rig folder to write.
  std::optional<scene::LengthUnit> units = {};
  std::string camera_size = {}, projector_size = {};  ///< "1280x800"; empty: not given.
  bool json = false;
};

/// `limn import rig`: makes a rig folder from the calibration of another program (exchange/rig_files.h) and
/// prints its devices.
Status run_import_rig(const ImportRigOptions& options);

}  // namespace limn::apps
