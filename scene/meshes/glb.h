#pragma once

#include <span>
#include <string>

#include "core/pose.h"
#include "scene/meshes/mesh.h"

namespace limn::scene {

/// A mesh with its pose.
struct GlbNode {
  std::string name;  ///< The node's name in the file.
  const Mesh* mesh = nullptr;
  Pose assembly_from_mesh;
  std::string extras = {};  ///< JSON that the node has as `extras`; empty: none.
};

/// The bytes of a binary glTF 2.0 file in metres. It has a node for each mesh with its pose and one primitive
/// per material, with positions, normals, both sets of uv and tangents (when present), base colours,
/// metalness, roughness, clearcoat, emission, and textures and surface maps as PNG. The same meshes give the
/// same bytes. There must be at least one mesh.
std::string encode_glb(std::span<const GlbNode> placed);

/// As above, for one mesh in its own frame and without its textures.
std::string encode_glb(const Mesh& mesh);

}  // namespace limn::scene
