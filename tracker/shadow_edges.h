#pragma once

#include <array>
#include <opencv2/core/mat.hpp>

#include "core/lens.h"
#include "tracker/pattern_fit.h"
#include "tracker/refine.h"

namespace limn::tracker {

/// What was found at a marker's sides.
enum class ShadowEdges {
  none,      ///< all sides lie on the ink's edges, as far as can be decided
  doubtful,  ///< a side may lie on a shadow's edge; its covariance is larger accordingly
  left       ///< a side lay on a shadow's edge and was moved
};

/// Moves sides that lie on a shadow's edge to the ink's edge. A shadow that ends on the paper beside the ink
/// makes a stronger edge, in grey levels, than the ink inside the shadow does. The shadow cannot change the
/// ratio between the light of paper and of ink beside it, which is known from the cells. Sides along which
/// too few places show that ratio get a large covariance. Does nothing where all sides agree, or where blur
/// leaves no flat levels between two edges. With a `lens`, sides are straight as in EdgeRefiner. `light` is
/// the light of each grey level (EdgeRefiner::light).
ShadowEdges leave_shadow_edges(const cv::Mat& grey,
                               const std::array<double, 256>& light,
                               const SeenCells& cells,
                               const Lens* lens,
                               RefinedQuad* refined);

}  // namespace limn::tracker
