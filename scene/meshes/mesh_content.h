#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"

namespace limn::scene {

/// Triangles of one material as a file states them: its unit, its frame, with node transforms applied.
struct MeshPiece {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  ///< Per position; zero or empty where the file states none.
  std::vector<Eigen::Vector2f> uvs;      ///< Per position, v counts up; empty: none. The file's set 0.
  std::map<int, std::vector<Eigen::Vector2f>> more_uvs = {};  ///< Further sets, by their numbers.
  std::vector<Eigen::Vector4f> tangents;  ///< Per position, as Mesh::tangents; empty: none.
  std::vector<Eigen::Vector3f> colours;   ///< Per position, linear RGB; empty: none.
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::size_t material = 0;  ///< Index into MeshContent::materials.
  /// The material in each of MeshContent::variants.
  std::vector<std::size_t> variant_materials = {};

  /// A set of texture coordinates; null when the piece has none of this number.
  const std::vector<Eigen::Vector2f>* find_uvs(int set) const;
};

/// Moves a vertex with its normal and tangent by an affine matrix, as a skin's joints do.
void move_vertex(const Eigen::Matrix4d& m, std::size_t vertex, MeshPiece* piece);

/// How a material's textures are mapped: which set of the file's texture coordinates they use, and how those
/// are transformed (glTF's KHR_texture_transform). v counts up.
struct TexturePlace {
  int coordinates = 0;
  Eigen::Affine2f moved = Eigen::Affine2f::Identity();
};

/// A texture that a material names.
struct TextureUse {
  std::string name = {};              ///< The image's file as written; empty: embedded, or no texture.
  std::filesystem::path folder = {};  ///< Where the file is searched first; empty: beside the mesh.
  int embedded = -1;                  ///< Index into MeshContent::images; -1: not embedded.
  TexturePlace place = {};
  bool is_there() const { return embedded >= 0 || !name.empty(); }
};

/// A material as a file states it. Colours are linear.
struct MaterialSource {
  std::string name = {};
  Eigen::Vector3f base_colour = Eigen::Vector3f::Ones();
  float alpha = 1;      ///< Multiplies the texture's alpha.
  float cut_below = 0;  ///< The alpha below which the surface has holes; 0: it has none.
  bool unlit = false;
  float metallic = 0, roughness = 1;
  Eigen::Vector3f emitted = Eigen::Vector3f::Zero();
  TextureUse base = {}, metallic_roughness = {}, normals = {}, occlusion = {}, emission = {};
  float normal_scale = 1, occlusion_strength = 1;
  struct Coat {
    float factor = 0, roughness = 0, normal_scale = 1;
    TextureUse factor_map = {}, roughness_map = {}, normals = {};
  };
  Coat coat = {};
};

/// The grey of surfaces whose file states no colour, linear.
inline constexpr float k_no_colour = 0.6F;

/// An image inside a mesh file: encoded as PNG, JPEG and so on, or 8-bit BGRA pixels.
struct EmbeddedImage {
  std::string bytes;
  cv::Mat pixels;
};

/// What a mesh file holds.
struct MeshContent {
  std::vector<MeshPiece> pieces;
  std::vector<MaterialSource> materials;
  std::vector<EmbeddedImage> images;
  std::vector<std::string> variants = {};  ///< Names of sets of other materials for the pieces.
  std::vector<std::string> warnings;       ///< What is shown otherwise than the file says.
  std::optional<double> metres_per_unit;   ///< Absent: the format states no unit.
};

/// The end of a file's name in lower case, such as ".glb".
std::string lower_extension(const std::filesystem::path& path);

/// A piece moved by an affine transform. One that mirrors turns the triangles, so that they face the same
/// side.
MeshPiece moved(const MeshPiece& piece, const Eigen::Matrix4d& to_from_piece);

/// Cuts a polygon, which may be concave, into triangles (ear clipping). The numbers are those of its corners.
/// Empty for fewer than three corners.
std::vector<std::array<std::uint32_t, 3>> polygon_triangles(const std::vector<Eigen::Vector3f>& corners);

/// Linear light of an sRGB value from 0 to 1; values outside are clamped.
float linear_from_srgb(float value);

/// The error for a file that ends too early or cannot be parsed.
Error damaged_mesh(const std::filesystem::path& path, const std::string& why);

}  // namespace limn::scene
