#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "core/imager.h"

namespace limn::apps {

/// How squarely a projector's light meets a marker: the cosine, 0 where it does not reach. Signs are the
/// affair of the projector that reaches a marker best: on a curved surface two would draw two.
double head_on(const Imager& projector, const Pose& world_from_marker);

/// Small signs beside a marker, in light. Frame: the marker's (x right, y down, z into the paper), as
/// `world_from_marker` places it; `size_m` is the marker's side. Drawn into an 8-bit BGR display image of
/// `projector`, brighter of the two. `strength`
/// (0 … 1) is the share of full light.

/// A ring around the marker's paper.
void draw_ring(const Imager& projector,
               const Pose& world_from_marker,
               double size_m,
               const cv::Scalar& colour,
               double strength,
               cv::Mat* image);

/// A word above the marker, half as high as its side.
void draw_word(const Imager& projector,
               const Pose& world_from_marker,
               double size_m,
               const std::string& word,
               double strength,
               cv::Mat* image);

}  // namespace limn::apps
