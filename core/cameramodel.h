#pragma once

#include <filesystem>

#include "core/imager.h"
#include "core/result.h"

namespace limn {

/// Reads mrcal's text format. The imager's name is the file's stem, the reference frame is the world.
Result<Imager> load_cameramodel(const std::filesystem::path& path);

/// Writes mrcal's text format with the extrinsics. When writing fails, `path` keeps its old content.
Status save_cameramodel(const Imager& imager, const std::filesystem::path& path);

}  // namespace limn
