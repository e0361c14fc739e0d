#pragma once

#include <vector>

#include "scene/meshes/mesh.h"

namespace limn::scene {

/// For each triangle, whether its piece of the mesh closes: along each side the piece's triangles run in one
/// direction as often as in the other, so that it has an inside. Triangles that share a side are of one
/// piece; corners at the same position count as one. A piece that does not close is a sheet.
std::vector<bool> are_of_closed_pieces(const Mesh& mesh);

/// What is nearer than this to a plane that cuts a mesh counts as removed, m. So a face in the plane gives
/// way to its cap as a whole.
constexpr double k_cut_margin_m = 1e-5;

}  // namespace limn::scene
