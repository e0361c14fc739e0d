#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "core/imager.h"
#include "projector/overlays/overlays.h"

namespace limn::remote {

/// A sign with a QR code, the PIN and its role below it, black on white: 8-bit BGR, `module_px` pixels for
/// each module of the code. Empty: the text is too long for a code.
cv::Mat pairing_code_image(const std::string& text,
                           const std::string& pin,
                           const std::string& role,
                           int module_px);

/// A sign with the PIN and its role only, `width` pixels wide, for places too small for the code.
cv::Mat pin_image(const std::string& pin, const std::string& role, int width);

/// The largest place for a sign of that shape, in the projector's pixels, on a flat piece of the prototype.
/// `points` holds the point of the prototype (m) at each projector pixel, CV_32FC3, NaN where there is none
/// or where nothing may be drawn; `d_up` is up in the prototype's frame. nullopt: no place is `least_px`
/// wide. It takes about 50 ms.
std::optional<projector::OverlayPlace> overlay_place(const Imager& projector,
                                                     const Pose& world_from_prototype,
                                                     const cv::Mat& points,
                                                     const Eigen::Vector3d& d_up,
                                                     cv::Size shape,
                                                     double least_px);

}  // namespace limn::remote
