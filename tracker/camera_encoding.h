#pragma once

#include "core/rig.h"
#include "tracker/refine.h"

namespace limn::apps {

/// How a camera writes light, as near as the detector can tell apart: by what was measured, else linear.
tracker::Encoding encoding_of(const Rig& rig, const Imager& camera);

}  // namespace limn::apps
