#pragma once

#include <opencv2/core/mat.hpp>

#include "core/marker.h"
#include "core/result.h"

namespace limn::apps {

/// A marker's black square as the tracker's families draw it: what sim::load_world asks for, for the virtual
/// rig must not know the tracker.
Result<cv::Mat> marker_image(const MarkerName& marker);

}  // namespace limn::apps
