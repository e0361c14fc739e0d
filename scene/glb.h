#pragma once

#include <string>

#include "scene/mesh.h"

namespace limn::sim {

/// The bytes of a binary glTF 2.0 file: positions, normals, uv when present, one primitive per material with
/// its base colour (textures are left out). The same mesh gives the same bytes.
std::string glb(const scene::Mesh& mesh);

}  // namespace limn::sim
