#pragma once

#include "core/result.h"
#include "core/rig.h"

namespace limn {

/// Multiplies the width and height of all of the rig's cameras and projectors by `share` (0 … 1). Error: a
/// share outside this range, or one that changes a device's aspect ratio. The message has no file name.
Status scale_resolution(double share, Rig* rig);

}  // namespace limn
