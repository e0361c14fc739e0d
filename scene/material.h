#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <string>

namespace limn::scene {

/// An image in a mesh's uv, 8-bit BGR, whose v counts up from its bottom row, as in OBJ; beyond 0 … 1 it
/// repeats.
struct Texture {
  cv::Mat image;     ///< empty: none
  std::string file;  ///< that it came from, for messages
};

/// What glTF's textures say of a surface beyond its colour. All but `emission` (sRGB) are numbers, 0 … 255
/// for 0 … 1.
struct SurfaceMaps {
  Texture metallic_roughness;  ///< blue and green multiply metalness and roughness
  Texture normals;         ///< x, y, z (red, green, blue) of 2 c - 1: along tangent, bitangent (up), normal
  Texture occlusion;       ///< red: share of soft light that arrives
  Texture emission;        ///< multiplies Material::emitted
  float normal_scale = 1;  ///< multiplies x and y of `normals`
  float occlusion_strength = 1;

  bool is_none() const {
    return metallic_roughness.image.empty() && normals.image.empty() && occlusion.image.empty() &&
           emission.image.empty();
  }
};

/// Surface of one piece of a mesh. Colours are linear light; the texture is sRGB, 8-bit BGR, or BGRA where
/// pieces are cut out, and multiplies base_colour. v of uv counts up from the image's bottom row, as in
/// OBJ.
struct Material {
  Eigen::Vector3f base_colour = {0.8f, 0.8f, 0.8f};
  bool unlit = false;  ///< KHR_materials_unlit: shown as its base colour
  float metallic = 0,
        roughness = 1;            ///< glTF's; not metallic and of roughness 1, without a map: diffuse alone
  cv::Mat texture;                ///< empty: none
  std::string texture_file = {};  ///< that it came from, for messages
  float cut_below = 0;            ///< where the texture's alpha (0 to 1) is less there is nothing
  Eigen::Vector3f emitted = Eigen::Vector3f::Zero();  ///< its own light, in whatever light it stands
  SurfaceMaps maps = {};
};

}  // namespace limn::scene
