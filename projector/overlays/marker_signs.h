#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "core/imager.h"

namespace limn::projector {

/// Cosine of the angle at which a projector's light meets a marker; 0 if the light does not reach it. Only
/// the projector with the largest cosine draws beside a marker: on a curved surface two would draw everything
/// twice.
double head_on(const Imager& projector, const Pose& world_from_marker);

/// The functions below draw small signs beside a marker into an 8-bit BGR display image of `projector`; of
/// the old and the new value, each pixel keeps the brighter one. `world_from_marker`: the pose of the
/// marker's frame (x right, y down, z into the paper). `size_m`: the marker's side. `strength`: share of the
/// full display value (0 … 1).

/// Draws a ring around the marker's paper.
void draw_ring(const Imager& projector,
               const Pose& world_from_marker,
               double size_m,
               const cv::Scalar& colour,
               double strength,
               cv::Mat* image);

/// Draws a word above the marker, about half as high as the marker's side.
void draw_word(const Imager& projector,
               const Pose& world_from_marker,
               double size_m,
               const std::string& word,
               double strength,
               cv::Mat* image);

}  // namespace limn::projector
