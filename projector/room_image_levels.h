#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

namespace limn::projector {

/// The picture of a room as surfaces of different roughness reflect it, for shaders/shading.glsl: the first
/// part of the split-sum approximation (Karis 2013). Equirectangular images of one size, CV_32FC3 (BGR).
/// Level k of the first k_roughness_levels holds what GGX of roughness (k / (k_roughness_levels - 1))^1.5
/// reflects towards the viewer when normal, view and mirror direction agree; the last one the diffuse light.
std::vector<cv::Mat> room_image_levels(const cv::Mat& light);

/// As in shaders/shading.glsl.
inline constexpr int k_roughness_levels = 9;

}  // namespace limn::projector
