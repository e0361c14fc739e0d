#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "scene/meshes/mesh.h"

namespace limn::sim {

/// Linear BGR of a texture (8-bit sRGB; grey, BGR or BGRA) at uv, interpolated between its pixels, or with
/// `sharp` that of the nearest pixel. Outside, the border is repeated.
Eigen::Vector3f textured(const cv::Mat& texture, const Eigen::Vector2f& uv, bool sharp);

/// Linear BGR and alpha (0 … 1; 1 where the image has none) of a texture that repeats, interpolated.
Eigen::Vector4f repeated_texture(const cv::Mat& texture, const Eigen::Vector2f& uv);

/// Whether the material's alpha at a place of a triangle is below its cutoff.
bool is_cut_out(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv);

/// Linear BGR of a mesh's own material at a place of a triangle. Textures repeat beyond their borders, as in
/// glTF. `colour_rgb`: the mesh's colour there (RayScene::colour).
Eigen::Vector3f material_albedo(const scene::Mesh& mesh,
                                int triangle,
                                const Eigen::Vector2f& uv,
                                const Eigen::Vector3f& colour_rgb);

/// The glTF 2.0 material at a place of a triangle, with textures and factors multiplied.
struct SurfaceMaterial {
  Eigen::Vector3d base;  ///< Base colour, linear BGR.
  bool is_unlit = false;
  double metallic = 0, roughness = 1;
  bool is_diffuse = false;  ///< Purely diffuse: neither metal nor gloss, and no texture of them.
  double occlusion = 1;     ///< Share of soft light that the occlusion map leaves.
  Eigen::Vector3d emitted;  ///< Emitted light, linear BGR.
  Eigen::Vector3d along;  ///< Normal from the normal map: components along tangent, bitangent and the mesh's
                          ///< normal; not of unit length.
  double coat = 0,
         coat_roughness = 0;  ///< The clear layer (KHR_materials_clearcoat): its share, its roughness.
  Eigen::Vector3d coat_along = Eigen::Vector3d::UnitZ();  ///< As `along`, for the clear layer.
};
/// `second_uv`: the place in the mesh's second texture coordinates (RayScene::second_uv).
SurfaceMaterial surface_material(const scene::Mesh& mesh,
                                 int triangle,
                                 const Eigen::Vector2f& uv,
                                 const Eigen::Vector3f& colour_rgb = Eigen::Vector3f::Ones(),
                                 const Eigen::Vector2f& second_uv = Eigen::Vector2f::Zero());

}  // namespace limn::sim
