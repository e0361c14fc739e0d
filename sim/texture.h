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

/// Linear BGR of a mesh's own material at a place of a triangle.
Eigen::Vector3f material_albedo(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv);

}  // namespace limn::sim
