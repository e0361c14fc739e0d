#pragma once

#include <Eigen/Core>
#include <span>

#include "scene/meshes/mesh.h"

namespace limn::scene {

/// Fills Mesh::tangents, which normal maps need. A vertex whose corners have different tangents is
/// duplicated. `of_corners` are the file's tangents, three per triangle (w as in Mesh::tangents), or empty. A
/// missing tangent (0) is computed from the uvs that the normal map lies in, of the triangles around the
/// corner that have the same handedness, weighted by their angle there, as in MikkTSpace. If the uvs have no
/// extent, any tangent is used. The mesh must have normals and uvs.
void add_tangents(Mesh* mesh, std::span<const Eigen::Vector4f> of_corners = {});

}  // namespace limn::scene
