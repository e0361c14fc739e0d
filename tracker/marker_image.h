#pragma once

#include "core/marker.h"
#include "core/marker_drawing.h"
#include "core/result.h"

namespace limn::tracker {

/// A marker as the tracker draws it. It is passed to sim::load_world, because the virtual rig
/// must not depend on the tracker.
Result<MarkerDrawing> marker_image(const MarkerName& marker);

}  // namespace limn::tracker
