#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/enum_names.h"
#include "core/result.h"
#include "scene/meshes/material.h"

namespace limn::scene {

/// A triangle mesh in metres, with the coordinates of its file (node transforms applied, no axis swapped).
struct Mesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< Unit normal per position; load_mesh always fills it.
  std::vector<Eigen::Vector2f> uvs;      ///< Per position; v counts up; empty: the mesh has none.
  /// Per position, for the textures that lie in them (Texture::in_second_uvs); empty: there are none.
  std::vector<Eigen::Vector2f> second_uvs = {};
  /// Unit tangent per position, along the surface towards increasing u. w is 1 where normal x tangent points
  /// towards increasing v, else -1. Empty when no material has a normal map (scene/meshes/tangents.h).
  std::vector<Eigen::Vector4f> tangents = {};
  /// Linear RGB per position, which multiplies the material's base colour; empty: the mesh has none.
  std::vector<Eigen::Vector3f> colours = {};
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::uint16_t> triangle_materials;  ///< Per triangle, index into materials.
  std::vector<Material> materials = {Material{}};
  double metres_per_unit = 1;  ///< The unit of the file's coordinates.
};

/// The unit of a mesh's coordinates.
enum class LengthUnit { metre, centimetre, millimetre, inch, foot };
inline constexpr EnumNames<LengthUnit, 5> k_length_units{{"m", "cm", "mm", "in", "ft"}};
inline std::string to_text(LengthUnit unit) { return k_length_units.text(unit); }
double metres_per_unit(LengthUnit units);

/// Reads a mesh file (docs/formats.md#meshes) and scales its coordinates by metres_per_unit(units). Without
/// `units` the unit is the one that the file states; `units` replaces it, with a message where they differ.
/// Missing normals are computed; equal vertices are merged. What is shown otherwise than the file says is a
/// warning. Errors: unreadable or truncated file, no triangles, NaN or infinite coordinates, no unit.
Result<Mesh> load_mesh(const std::filesystem::path& path, std::optional<LengthUnit> units);

/// For each vertex, the first vertex at its position.
std::vector<std::uint32_t> first_at_place(const Mesh& mesh);

/// A mesh with the other materials that its file offers under names (glTF's KHR_materials_variants).
struct MeshWithVariants {
  struct Variant {
    std::string name;  ///< As in the file; each name occurs once, and none is empty.
    Mesh mesh;         ///< The same shape. Its textures are shared with the other variants.
  };
  Mesh mesh;  ///< With the materials that the file uses by default.
  std::vector<Variant> variants;
};

/// As load_mesh(), with all material variants of the file.
Result<MeshWithVariants> load_mesh_with_variants(const std::filesystem::path& path,
                                                 std::optional<LengthUnit> units);

}  // namespace limn::scene
