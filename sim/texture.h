#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "scene/mesh.h"

namespace limn::sim {

/// Linear BGR of a texture (8-bit sRGB; grey, BGR or BGRA) at uv, interpolated between its pixels, or with
/// `sharp` the pixel's; beyond the border the border's.
Eigen::Vector3f textured(const cv::Mat& texture, const Eigen::Vector2f& uv, bool sharp);

/// Whether a mesh's material has nothing at a place of a triangle.
bool is_cut_out(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv);

/// Linear BGR of a mesh's own material at a place of a triangle. Beyond its border a texture repeats, as in
/// glTF.
Eigen::Vector3f material_albedo(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv);

/// What glTF 2.0 says of a surface at a place of a triangle, textures and factors multiplied.
struct SurfaceMaterial {
  Eigen::Vector3d base;  ///< colour, linear BGR
  bool is_unlit = false;
  double metallic = 0, roughness = 1;
  bool is_plain = false;    ///< diffuse alone: neither metal nor gloss, and no texture of them
  double open = 1;          ///< share of soft light that occlusion leaves
  Eigen::Vector3d emitted;  ///< light of its own, linear BGR
  Eigen::Vector3d along;  ///< its normal: along tangent, bitangent and the mesh's normal; not of unit length
};
SurfaceMaterial surface_material(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv);

}  // namespace limn::sim
