#pragma once

#include <filesystem>

#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Reads the build items of a 3MF file with their components, also those in other model files of the package
/// (production extension), in the unit that the file states (mm without one). Colours of triangles and
/// vertices come from base materials and colour groups (sRGB). A warning names textures and other properties
/// that are not read.
Result<MeshContent> read_3mf(const std::filesystem::path& path);

}  // namespace limn::scene
