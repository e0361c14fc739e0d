#pragma once

#include "core/result.h"
#include "core/rig.h"

namespace limn {

/// Gives a rig's cameras and projectors this share (0 … 1) of their pixels a side. Error, as a sentence
/// without a place: a share that is none, or that does not leave a device its shape.
Status scale_resolution(double share, Rig* rig);

}  // namespace limn
