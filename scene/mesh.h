#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// Surface of one piece of a mesh. Colours are linear light; the texture is sRGB, 8-bit BGR, or BGRA where
/// pieces are cut out, and multiplies base_colour. v of uv counts up from the picture's bottom row, as in OBJ.
struct Material {
  Eigen::Vector3f base_colour = {0.8f, 0.8f, 0.8f};
  bool unlit = false;                 ///< KHR_materials_unlit: shown as its base colour
  float metallic = 0, roughness = 1;  ///< glTF's; not metallic and of roughness 1 is diffuse alone
  cv::Mat texture;                    ///< empty: none
  std::string texture_file = {};      ///< that it came from, for messages
  float cut_below = 0;                ///< where the texture's alpha (0 to 1) is less there is nothing
};

/// Triangles in metres; coordinates as stored in the file (node transforms applied, no axis swapped).
struct Mesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< unit, per position; always filled by load_mesh
  std::vector<Eigen::Vector2f> uvs;      ///< per position; empty: none
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
