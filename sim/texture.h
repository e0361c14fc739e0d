#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "scene/mesh.h"

namespace limn::sim {

/// Linear BGR of a texture (8-bit sRGB, grey or BGR) at uv, interpolated between its pixels, or with `sharp`
/// the pixel's; beyond the border the border's.
Eigen::Vector3f textured(const cv::Mat& texture, const Eigen::Vector2f& uv, bool sharp);

/// Linear BGR of a mesh's own material at a place of a triangle.
Eigen::Vector3f material_albedo(const scene::Mesh& mesh, int triangle, const Eigen::Vector2f& uv);

}  // namespace limn::sim
