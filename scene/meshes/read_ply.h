#pragma once

#include <filesystem>

#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Reads the faces and triangle strips of a PLY file, ASCII or binary. Colours of vertices (red, green,
/// blue, or diffuse_red ...; integers, or numbers from 0 to 1) and of faces are taken as sRGB. Texture
/// coordinates are those of the vertices (s and t, u and v, texture_u and texture_v) or of the corners (the
/// list texcoord); images are the comments TextureFile. A face with fewer than three corners is skipped,
/// with a warning. Errors: a file that ends too early, an index beyond the vertices.
Result<MeshContent> read_ply(const std::filesystem::path& path);

}  // namespace limn::scene
