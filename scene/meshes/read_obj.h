#pragma once

#include <filesystem>

#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Reads a Wavefront OBJ file with its MTL files: polygons, indices that count backwards, lines that go on
/// after a backslash, colours behind a vertex's coordinates (sRGB), any blanks. A missing MTL or material is
/// a warning. Errors: a line that cannot be read, with its number.
Result<MeshContent> read_obj(const std::filesystem::path& path);

}  // namespace limn::scene
