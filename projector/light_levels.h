#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "core/rig.h"

namespace limn::projector {

/// Light of a projector's display values 0 … 255 as a share of its white, black's included: CV_32FC3 (BGR),
/// 1 x 256. By the rig's measured response; without one, gamma 2.2.
cv::Mat light_of_display(const Rig& rig, const std::string& projector);

/// Light that a camera's levels 0 … 255 mean, as a share of full scale: CV_32F, 1 x 256. By the rig's
/// measured response; without one, sRGB.
cv::Mat light_of_levels(const Rig& rig, const std::string& camera);

/// CV_32F of CV_32FC3 linear BGR (BT.709).
cv::Mat luminance(const cv::Mat& light);

}  // namespace limn::projector
