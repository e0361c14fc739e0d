#pragma once

#include <opencv2/core/mat.hpp>

namespace limn::projector {

/// How a glTF surface (GGX, Smith's shadowing, glTF 2.0 appendix B) reflects the soft light, for
/// shaders/shading.glsl: CV_32FC4, 32 x 32 nodes. Rows: roughness 0 … 1. For channels 0, 1 and 3 the columns
/// are the cosine between normal and viewing direction, 0 … 1. Channels 0 and 1 are the two terms of the
/// split-sum approximation (Karis 2013): factors of the colour at normal incidence and of white. Channel 3
/// says where most of the reflected light comes from: 0 is the normal, 1 the mirror direction. For channel 2
/// the columns are the height of that direction, -1 … 1, and the value is the share of the reflected light
/// that comes from above the horizon. Computed at the first call.
const cv::Mat& brdf_lut();

}  // namespace limn::projector
