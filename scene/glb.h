#pragma once

#include <span>
#include <string>

#include "core/pose.h"
#include "scene/mesh.h"

namespace limn::scene {

/// A mesh in its place.
struct GlbNode {
  std::string name;  ///< of its node
  const Mesh* mesh = nullptr;
  Pose assembly_from_mesh;
};

/// The bytes of a binary glTF 2.0 file, metres: a node for each mesh with its pose, one primitive per
/// material; positions, normals, uv and tangents when present, base colours, metalness, roughness, textures
/// and maps of the surface as PNG inside. The same meshes give the same bytes. Needs at least one mesh.
std::string encode_glb(std::span<const GlbNode> placed);

/// The same of one mesh in its own frame, without its textures.
std::string encode_glb(const Mesh& mesh);

}  // namespace limn::scene
