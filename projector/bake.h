#pragma once

#include <opencv2/core/mat.hpp>

#include "core/imager.h"
#include "core/rig.h"
#include "projector/pinhole_view.h"

namespace limn::projector {

/// A lens as lookup tables for the GPU, so that mrcal's formulas are implemented only once, in mrcal.
struct BakedLens {
  cv::Mat tangents;  ///< CV_32FC2: Tangents x/z, y/z of every `step`-th pixel, CV_32FC2, at least one node
                     ///< beyond the image. NaN: the lens has no direction there.
  int step = 1;
  TangentRect rect;  ///< Bounds of the directions of all pixels.
};

/// The spacing of the nodes (1 to 4 pixels) is the widest at which interpolation differs from the exact lens
/// by at most 0.005 px.
BakedLens baked(const Imager& imager);

/// The inverse of `baked`: CV_32FC2, the imager's pixel at each node of a grid of columns x rows tangents
/// that spans `rect`; -1e6 where the lens has none.
cv::Mat pixel_map(const Imager& imager, const TangentRect& rect, int columns, int rows);

/// The bounding rectangle, with a margin, of the pixels whose directions lie in `rect`; empty when there are
/// none.
cv::Rect pixels_of(const Imager& imager, const BakedLens& lens, const TangentRect& rect);

/// CV_32FC3 (r, g, b), 1 row: entry k is the display value that gives the light (k / (columns - 1))^2, by the
/// measured response, or by gamma 2.2 when `response` is null.
cv::Mat response_table(const ProjectorResponse* response, int columns);

}  // namespace limn::projector
