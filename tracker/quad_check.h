#pragma once

#include <opencv2/core/mat.hpp>

#include "tracker/candidates.h"

namespace limn::tracker {

/// Cheap checks that reject most quads of clutter before they are refined and read.

/// Whether the inside could be a marker's, for a quad whose corners are good to a few pixels: a dark border
/// around something that is lighter by at least min_contrast levels. `border` is the width of the thinnest
/// border, as share of the side. Costs a tenth of refining the quad.
bool may_be_marker(const cv::Mat& grey, const Quad& quad, double min_contrast, double border = 1.0 / 9);

/// Whether it could be a code that is partly hidden: most of the border is dark, and the cells change as
/// often as a code's do. Rejects nine in ten quadrilaterals of clutter.
bool may_be_covered_code(const cv::Mat& grey, const Quad& quad);

}  // namespace limn::tracker
