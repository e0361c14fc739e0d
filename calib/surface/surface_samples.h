#pragma once

#include <cstddef>
#include <vector>

#include "scene/meshes/mesh.h"
#include "scene/meshes/scan_surface.h"

namespace limn::calib {

/// Points spread over a mesh and the triangles between them, in the mesh's frame.
struct SurfaceSamples {
  scene::ScanSurface surface;   ///< Positions (m), unit normals, triangles.
  std::vector<float> areas_m2;  ///< The share of the mesh's area that each point stands for.
  double spacing_m = 0;         ///< No edge is longer, unless points were merged.
};

/// The area of a mesh, m².
double area_of(const scene::Mesh& mesh);

/// Divides the mesh's triangles until no edge is longer than `spacing_m`. When these are more than `most`
/// points, `spacing_m` grows to what `most` points over the mesh's area allow, and points of one cell of that
/// size that face the same way are merged to the one nearest to their middle. So the result's size does not
/// depend on the number of triangles, and every point lies on the mesh. Triangles face as those of the mesh
/// do; those without an area are left out.
SurfaceSamples surface_samples(const scene::Mesh& mesh, double spacing_m, std::size_t most);

}  // namespace limn::calib
