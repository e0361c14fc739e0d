#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/result.h"
#include "scene/meshes/mesh.h"

namespace limn::scene {

/// A measured surface: points (m) and their properties. Each array has one element per point or is empty.
struct ScanSurface {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< Unit normals, towards the side that measured.
  std::vector<float> stddevs;            ///< Standard deviation of the position along the normal, m.
  std::vector<std::array<std::uint8_t, 3>> colours_rgb;
  /// Counter-clockwise from outside; empty for a point cloud.
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Writes a binary PLY in metres (vertex: x y z, nx ny nz, stddev, red green blue; face: vertex_indices).
/// When writing fails, `path` keeps its old content.
Status save_ply(const ScanSurface& surface, const std::filesystem::path& path);

/// Reads a PLY: ASCII or binary of either byte order; other properties are ignored. Faces with more than
/// three corners become triangle fans. `metres_per_unit` scales positions and stddevs. Missing normals are
/// computed from the faces. Errors: not a PLY, truncated, no points, indices beyond the points, positions
/// that are not finite, neither normals nor faces.
Result<ScanSurface> load_ply(const std::filesystem::path& path, double metres_per_unit = 1);

/// The pieces of a surface that its triangles connect, the largest area first.
struct ConnectedComponents {
  std::vector<int> of_vertex;  ///< Each vertex's piece; -1: none.
  std::vector<double> areas;   ///< Area of each piece, m².
};
ConnectedComponents connected_components(const ScanSurface& surface);

/// The surface's triangles as a mesh with one material, for what takes meshes, such as MeshBvh.
Mesh mesh_of(const ScanSurface& surface);

/// The vertices with `keep` set and the triangles between them.
ScanSurface with_vertices_kept(const ScanSurface& surface, const std::vector<bool>& keep);

/// Unit normals of the vertices from the triangles around them, weighted by area; zero for a vertex without
/// triangles.
std::vector<Eigen::Vector3f> normals_from_triangles(const ScanSurface& surface);

}  // namespace limn::scene
