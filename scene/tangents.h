#pragma once

#include <Eigen/Core>
#include <span>

#include "scene/mesh.h"

namespace limn::scene {

/// Fills Mesh::tangents, as maps of normals need them; corners that share a position but not a tangent are
/// parted. `of_corners`, three a triangle or none, are those of the file (w as in Mesh::tangents); where one
/// is missing (0) it is made from the uvs: of the triangles around a corner that agree in handedness,
/// weighted by their angle there, as MikkTSpace does. Where uvs have no extent it is any one. Needs normals
/// and uvs.
void add_tangents(Mesh* mesh, std::span<const Eigen::Vector4f> of_corners = {});

}  // namespace limn::scene
