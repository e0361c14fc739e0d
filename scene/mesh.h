#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "scene/material.h"

namespace limn::scene {

/// Triangles in metres; coordinates as stored in the file (node transforms applied, no axis swapped).
struct Mesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< unit, per position; always filled by load_mesh
  std::vector<Eigen::Vector2f> uvs;      ///< per position; empty: none; v counts up
  /// Per position: unit, along the surface towards growing u; w: 1 where normal x tangent goes towards
  /// growing v, else -1. Empty: no material has a map of normals (scene/tangents.h).
  std::vector<Eigen::Vector4f> tangents = {};
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::uint16_t> triangle_materials;  ///< per triangle, index into materials
  std::vector<Material> materials = {Material{}};
};

/// Metres per unit: m, cm, mm, in, ft. Error for any other word.
Result<double> metres_per_unit(const std::string& units);

/// Reads glb, gltf, obj, stl or ply and scales by metres_per_unit(units). Missing normals are made; vertices
/// are joined. Errors: unreadable or truncated file, no triangles, NaN or infinite coordinates, unknown
/// units.
Result<Mesh> load_mesh(const std::filesystem::path& path, const std::string& units);

}  // namespace limn::scene
