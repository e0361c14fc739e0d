#pragma once

#include <opencv2/core/mat.hpp>

#include "core/rig.h"

namespace limn {

/// Converts an 8-bit image with values proportional to light to sRGB, as screens expect it.
cv::Mat srgb_image(const cv::Mat& linear);

/// Whether the camera's response was measured and is linear. Such images look too dark on a screen.
bool is_measured_linear(const Rig& rig, const Imager& camera);

}  // namespace limn
