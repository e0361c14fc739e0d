#pragma once

#include <opencv2/core/mat.hpp>

namespace limn::projector {

/// How a glTF surface (GGX, Smith's shadowing, appendix B) mirrors soft light, for shaders/look.glsl:
/// CV_32FC4, 32 x 32 nodes, roughness 0 … 1 down. By the cosine to the eye 0 … 1: factors of the colour head
/// on and of white (channels 0 and 1, the split sum of Karis 2013), and what mixes normal (0) and mirrored
/// direction (1) to the one that most is mirrored from (3). By the height -1 … 1 of that: share of the
/// mirrored light that comes from above the horizon (2). Made at the first call.
const cv::Mat& brdf_lut();

}  // namespace limn::projector
