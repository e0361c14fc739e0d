#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// A measured surface: points (m), and what is known of each. Arrays run in parallel or are empty.
struct ScanSurface {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< unit, towards whoever measured
  std::vector<float> stddevs;            ///< of the place along the normal, m
  std::vector<std::array<std::uint8_t, 3>> colours_rgb;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< empty: a cloud; counter-clockwise from outside
};

/// Writes a binary PLY (vertex: x y z, nx ny nz, stddev, red green blue; face: vertex_indices) in metres,
/// through a temporary file.
Status save_ply(const ScanSurface& surface, const std::filesystem::path& path);

/// Reads a PLY, ASCII or binary of either byte order, with any further properties; faces of more than three
/// corners become fans. `metres_per_unit` scales positions and stddevs. Missing normals are made from the
/// faces. Errors: no PLY, truncated, no points, indices beyond them, places that are not finite, neither
/// normals nor faces.
Result<ScanSurface> load_ply(const std::filesystem::path& path, double metres_per_unit = 1);

/// Connected pieces of a surface by its triangles, the largest area first: which piece each vertex is of (-1:
/// none) and the areas (m²).
struct ConnectedComponents {
  std::vector<int> of_vertex;
  std::vector<double> areas;
};
ConnectedComponents connected_components(const ScanSurface& surface);

/// The vertices with `keep` set and the triangles between them.
ScanSurface with_vertices_kept(const ScanSurface& surface, const std::vector<bool>& keep);

/// Unit normals of the vertices from the triangles around them, weighted by area; zero without any.
std::vector<Eigen::Vector3f> normals_from_triangles(const ScanSurface& surface);

}  // namespace limn::scene
