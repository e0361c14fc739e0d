#pragma once

#include <filesystem>
#include <vector>

#include "core/result.h"
#include "scene/material.h"

struct aiScene;

namespace limn::scene {

/// The materials of a mesh file with their textures. Of glTF's, maps beyond the colour that cannot be read
/// are told and left out; a base colour texture that cannot be read is an error.
Result<std::vector<Material>> read_materials(const aiScene& scene,
                                             const std::filesystem::path& path,
                                             bool is_gltf);

}  // namespace limn::scene
