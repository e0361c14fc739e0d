#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "core/imager.h"
#include "session/overlays.h"

namespace limn::remote {

/// A code that phones read, over a PIN and whose it is, in black on white: 8-bit BGR, `module_px` pixels for
/// each module of the code. Empty: the text is too long for a code.
cv::Mat pairing_code_image(const std::string& text,
                           const std::string& pin,
                           const std::string& role,
                           int module_px);

/// The PIN and whose it is alone, `width` pixels wide: for where there is no room for the code.
cv::Mat pin_image(const std::string& pin, const std::string& role, int width);

/// The largest place, in the projector's pixels, for a sign of that shape on a flat enough piece of the
/// prototype. `points` is the prototype's point (m) that each of its pixels lights, CV_32FC3, NaN where none
/// is or where nothing may be drawn; `d_up` is up in the prototype's frame. nullopt: none is `least_px` wide.
/// Some 50 ms.
std::optional<apps::OverlayPlace> overlay_place(const Imager& projector,
                                                const Pose& world_from_prototype,
                                                const cv::Mat& points,
                                                const Eigen::Vector3d& d_up,
                                                cv::Size shape,
                                                double least_px);

}  // namespace limn::remote
