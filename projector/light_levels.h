#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "core/rig.h"

namespace limn::projector {

/// The light of a projector's display values 0 … 255 as a share of its white; the black level is included.
/// CV_32FC3 (BGR), 1 x 256. From the rig's measured response, or gamma 2.2 if there is none.
cv::Mat light_of_display(const Rig& rig, const std::string& projector);

/// The light that a camera's grey levels 0 … 255 stand for, as a share of full scale: CV_32F, 1 x 256. From
/// the rig's measured response, or sRGB if there is none.
cv::Mat light_of_levels(const Rig& rig, const std::string& camera);

/// Luminance (BT.709) as CV_32F; `light` is CV_32FC3 linear BGR.
cv::Mat luminance(const cv::Mat& light);

}  // namespace limn::projector
