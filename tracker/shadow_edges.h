#pragma once

#include <array>
#include <opencv2/core/mat.hpp>

#include "core/lens.h"
#include "tracker/pattern_fit.h"
#include "tracker/refine.h"

namespace limn::tracker {

/// What was made of a marker's sides.
enum class ShadowEdges {
  none,      ///< all lie on the ink's edges, as far as can be told
  doubtful,  ///< one may lie on a shadow's; its covariance says so
  left       ///< one did
};

/// Puts sides that lie on a shadow's edge where the ink's edge is. A shadow that ends on the paper beside the
/// ink makes an edge of more grey levels than the ink's own within the shadow; what it can't change is by how
/// many times ink is darker than the paper beside it, which the cells tell. Sides along which too few places
/// show that ratio anywhere get a large covariance. Does nothing where all sides agree, or blur leaves no
/// levels between two edges. With a `lens` sides are straight as EdgeRefiner's are. `light`
/// is that of a grey level (EdgeRefiner::light).
ShadowEdges leave_shadow_edges(const cv::Mat& grey,
                               const std::array<double, 256>& light,
                               const SeenCells& cells,
                               const Lens* lens,
                               RefinedQuad* refined);

}  // namespace limn::tracker
