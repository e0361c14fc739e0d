#pragma once

#include <filesystem>

#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Reads a mesh file by the library assimp: FBX, COLLADA, 3DS and others. Node transforms are applied, axes
/// are not swapped; skins stand in the pose of their nodes. Colours of vertices are taken as sRGB. FBX (cm
/// unless it says otherwise), COLLADA (m) and AMF (mm) state their unit. Morph targets are not applied, with
/// a warning. It must be used by one thread at a time, because assimp's logger is global.
/// Error also: the shared library with assimp (scene/meshes/readers/) is not there.
Result<MeshContent> read_with_assimp(const std::filesystem::path& path);

}  // namespace limn::scene
