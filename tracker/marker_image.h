#pragma once

#include <opencv2/core/mat.hpp>

#include "core/marker.h"
#include "core/result.h"

namespace limn::tracker {

/// A marker's black square as the tracker draws it. It is passed to sim::load_world, because the virtual rig
/// must not depend on the tracker.
Result<cv::Mat> marker_image(const MarkerName& marker);

}  // namespace limn::tracker
