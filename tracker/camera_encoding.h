#pragma once

#include "core/rig.h"
#include "tracker/refine.h"

namespace limn::tracker {

/// Whether a camera's grey levels are linear or sRGB, whichever is nearer to its measured response; linear
/// when it was not measured.
tracker::Encoding encoding_of(const Rig& rig, const Imager& camera);

}  // namespace limn::tracker
