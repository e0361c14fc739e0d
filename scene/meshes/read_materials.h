#pragma once

#include <filesystem>
#include <vector>

#include "core/result.h"
#include "scene/meshes/material.h"
#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// All textures that a material names, the base colour first.
std::vector<const TextureUse*> texture_uses(const MaterialSource& material);

/// The mappings of a material's textures that are shown: that of its first texture, for Mesh::uvs, and the
/// next other one, for Mesh::second_uvs. The untransformed first set where it has no texture.
std::vector<TexturePlace> texture_places(const MaterialSource& material);
/// Whether both are the same mapping.
bool is_same_place(const TexturePlace& a, const TexturePlace& b);
/// The mapping of the normal map that the tangents belong to.
TexturePlace tangent_place(const MaterialSource& material);

/// The materials of a mesh file with their textures, as far as its pieces use them in any variant. A base
/// colour texture that cannot be read is an error. Other maps that cannot be read cause a warning and are
/// left out. A texture whose mapping is none of texture_places() causes a warning, too, and so does one whose
/// name differs in upper and lower case.
Result<std::vector<Material>> read_materials(const MeshContent& content, const std::filesystem::path& path);

}  // namespace limn::scene
