#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <string>

namespace limn::scene {

/// An 8-bit BGR image in a mesh's uv coordinates. v counts up from its bottom row, as in OBJ; outside 0 … 1
/// the image repeats.
struct Texture {
  cv::Mat image;               ///< Empty: no texture.
  std::string file;            ///< The file it came from, for messages.
  bool in_second_uvs = false;  ///< It lies in Mesh::second_uvs instead of Mesh::uvs.
};

/// A surface's glTF textures other than its colour. Except for `emission` (sRGB), the levels 0 … 255 stand
/// for numbers from 0 to 1.
struct SurfaceMaps {
  Texture metallic_roughness;  ///< Blue multiplies metalness, green multiplies roughness.
  /// Normals as 2 c - 1; red, green and blue are the parts along the tangent, the bitangent (up) and the
  /// normal.
  Texture normals;
  Texture occlusion;       ///< Red: share of the soft light that arrives.
  Texture emission;        ///< Multiplies Material::emitted.
  float normal_scale = 1;  ///< Multiplies x and y of `normals`.
  float occlusion_strength = 1;

  bool is_none() const {
    return metallic_roughness.image.empty() && normals.image.empty() && occlusion.image.empty() &&
           emission.image.empty();
  }
};

/// A clear layer over a surface, such as varnish (glTF's KHR_materials_clearcoat).
struct Clearcoat {
  float factor = 0;            ///< Share of the surface that it covers, 0 … 1. 0: there is none.
  float roughness = 0;         ///< As in glTF.
  Texture factor_map = {};     ///< Red multiplies `factor`.
  Texture roughness_map = {};  ///< Green multiplies `roughness`.
  Texture normals = {};        ///< As SurfaceMaps::normals. Empty: the layer has the mesh's own normals.
  float normal_scale = 1;      ///< Multiplies x and y of `normals`.

  bool has_maps() const {
    return !factor_map.image.empty() || !roughness_map.image.empty() || !normals.image.empty();
  }
};

/// The surface of one piece of a mesh. Colours are linear light. The texture is sRGB, 8-bit BGR (BGRA where
/// parts of it are cut out), and multiplies base_colour. v of uv counts up from the image's bottom row, as in
/// OBJ.
struct Material {
  Eigen::Vector3f base_colour = {0.8f, 0.8f, 0.8f};
  bool unlit = false;  ///< KHR_materials_unlit: shown in its base colour without shading.
  float metallic = 0,
        roughness = 1;            ///< As in glTF. Metalness 0 and roughness 1 without a map: diffuse only.
  cv::Mat texture;                ///< Empty: no texture.
  std::string texture_file = {};  ///< The file it came from, for messages.
  float cut_below = 0;            ///< The surface has holes where the texture's alpha (0 to 1) is below this.
  Eigen::Vector3f emitted = Eigen::Vector3f::Zero();  ///< Light that the surface emits itself.
  SurfaceMaps maps = {};
  Clearcoat coat = {};
};

}  // namespace limn::scene
