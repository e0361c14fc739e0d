#pragma once

#include <opencv2/core/mat.hpp>

#include "core/rig.h"

namespace limn {

/// An 8-bit image whose values are proportional to light, as screens want it: sRGB.
cv::Mat srgb_image(const cv::Mat& linear);

/// Whether a response was measured of the camera and is linear: then its images are too dark for screens.
bool is_measured_linear(const Rig& rig, const Imager& camera);

}  // namespace limn
