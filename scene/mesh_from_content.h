#pragma once

#include <filesystem>
#include <optional>

#include "core/result.h"
#include "scene/mesh.h"
#include "scene/mesh_content.h"

namespace limn::scene {

/// The mesh of what a file holds, as load_mesh() returns it. `path` is the file: textures that are not inside
/// it are searched beside it, and messages begin with it.
Result<Mesh> mesh_from_content(const MeshContent& content,
                               const std::filesystem::path& path,
                               std::optional<LengthUnit> units);

}  // namespace limn::scene
