#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <vector>

#include "core/result.h"
#include "scene/material.h"

struct aiMaterial;
struct aiScene;

namespace limn::scene {

/// How a material's textures are mapped: which set of the file's texture coordinates they use, and how those
/// are transformed (glTF's KHR_texture_transform). v counts up.
struct TexturePlace {
  int coordinates = 0;
  Eigen::Affine2f moved = Eigen::Affine2f::Identity();
};

/// The mapping of the base colour texture, or of the material's first texture if it has no base colour
/// texture. All textures of the material are shown with this mapping.
TexturePlace texture_place(const aiMaterial& material);

/// The materials of a mesh file with their textures. A base colour texture that cannot be read is an error.
/// Other glTF maps that cannot be read cause a warning and are left out. A texture whose own mapping differs
/// from the material's causes a warning, too.
Result<std::vector<Material>> read_materials(const aiScene& scene,
                                             const std::filesystem::path& path,
                                             bool is_gltf);

}  // namespace limn::scene
