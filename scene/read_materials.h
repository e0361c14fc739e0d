#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <vector>

#include "core/result.h"
#include "scene/material.h"

struct aiMaterial;
struct aiScene;

namespace limn::scene {

/// Where a material's textures lie: in which of the file's texture coordinates, and how those are moved
/// (glTF's KHR_texture_transform). v counts up.
struct TexturePlace {
  int coordinates = 0;
  Eigen::Affine2f moved = Eigen::Affine2f::Identity();
};

/// The place of the base colour texture, without one that of the first texture there is: all of a material
/// are shown there.
TexturePlace texture_place(const aiMaterial& material);

/// The materials of a mesh file with their textures. Of glTF's, maps beyond the colour that cannot be read
/// are told and left out; a base colour texture that cannot be read is an error. A texture whose own place is
/// another than the material's is told.
Result<std::vector<Material>> read_materials(const aiScene& scene,
                                             const std::filesystem::path& path,
                                             bool is_gltf);

}  // namespace limn::scene
