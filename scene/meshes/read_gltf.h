#pragma once

#include <filesystem>

#include "scene/meshes/mesh_content.h"

namespace limn::scene {

/// Reads a glTF 2.0 file (.gltf or .glb): the nodes of its scene with their transforms, skins in the pose of
/// their nodes, default morph weights, instances (EXT_mesh_gpu_instancing), sparse and quantised accessors,
/// buffers compressed by meshopt, and Draco. glTF 1.0 is left to assimp. In metres. Errors: a needed
/// extension that Limn does not read, indices or buffers beyond their ends.
Result<MeshContent> read_gltf(const std::filesystem::path& path);

}  // namespace limn::scene
