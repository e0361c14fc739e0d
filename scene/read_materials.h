#pragma once

#include <filesystem>
#include <vector>

#include "core/result.h"
#include "scene/material.h"
#include "scene/mesh_content.h"

namespace limn::scene {

/// The mapping of the base colour texture, or of the material's first texture if it has no base colour
/// texture. All textures of the material are shown with this mapping.
TexturePlace texture_place(const MaterialSource& material);

/// The materials of a mesh file with their textures. A base colour texture that cannot be read is an error.
/// Other maps that cannot be read cause a warning and are left out. A texture whose own mapping differs from
/// the material's causes a warning, too, and so does one whose name differs in upper and lower case.
Result<std::vector<Material>> read_materials(const MeshContent& content, const std::filesystem::path& path);

}  // namespace limn::scene
