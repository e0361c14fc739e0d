#pragma once

#include <filesystem>
#include <optional>

#include "core/result.h"
#include "scene/meshes/mesh.h"
#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// The meshes of what a file holds, as load_mesh_with_variants() returns them. `path` is the file: textures
/// that are not inside it are searched beside it, and messages begin with it.
Result<MeshWithVariants> meshes_from_content(MeshContent content,
                                             const std::filesystem::path& path,
                                             std::optional<LengthUnit> units);

}  // namespace limn::scene
