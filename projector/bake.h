#pragma once

#include <opencv2/core/mat.hpp>

#include "core/imager.h"
#include "core/rig.h"
#include "projector/pinhole_view.h"

namespace limn::projector {

/// A lens as tables for the GPU, so that mrcal's formulas are spelled nowhere else.
struct BakedLens {
  cv::Mat tangents;  ///< CV_32FC2: x/z, y/z of every `step`-th pixel, at least one node beyond the image;
                     ///< NaN: none
  int step = 1;
  TangentRect rect;  ///< of all directions of the image
};

/// Nodes are as far apart (4 pixels or fewer) as keeps the lens within 0.005 px of the exact one between
/// them.
BakedLens baked(const Imager& imager);

/// The other way: CV_32FC2, pixels of the imager over a grid of columns x rows tangents that spans `rect`;
/// -1e6 where the lens has none.
cv::Mat pixel_map(const Imager& imager, const TangentRect& rect, int columns, int rows);

/// The rectangle of pixels, with a margin, whose directions lie in `rect`; empty when none do.
cv::Rect pixels_of(const Imager& imager, const BakedLens& lens, const TangentRect& rect);

/// CV_32FC3 (r, g, b), 1 row: display value that gives the light (k / (columns - 1))^2 by the measured
/// response, gamma 2.2 when `response` is null.
cv::Mat response_table(const ProjectorResponse* response, int columns);

}  // namespace limn::projector
