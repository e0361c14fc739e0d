#pragma once

#include <opencv2/core/mat.hpp>

#include "tracker/candidates.h"
#include "tracker/family.h"

namespace limn::tracker {

/// Cheap checks that reject most quads of clutter before they are refined and read.

/// Whether the inside could be a marker's, for a quad whose corners are good to a few pixels: a dark border
/// around something that is lighter by at least min_contrast levels. `border` is the width of the thinnest
/// border, as share of the side. Costs a tenth of refining the quad.
bool may_be_marker(const cv::Mat& grey, const Quad& quad, double min_contrast, double border = 1.0 / 9);

/// Whether it could be a code that is partly hidden: most of the border is dark, and the cells change as
/// often as a code's do. Rejects nine in ten quadrilaterals of clutter.
bool may_be_covered_code(const cv::Mat& grey, const Quad& quad);

/// Whether the nearest pixels show a code that can_have_broken_side(), but for two cells, and a border that
/// is dark, but for four, in a square that is not steep. Costs as much as may_be_covered_code.
bool may_be_code_with_broken_side(const cv::Mat& grey, const Quad& quad, const Families& families);

}  // namespace limn::tracker
