#pragma once

#include "calib/capture_set.h"
#include "core/result.h"

namespace limn::calib {

/// Checks the files of all images before the long computation, scene captures included. Errors: a PNG that is
/// truncated or of another size than its camera's; the same bytes in two places where the patterns differ
/// (both are named); a pose, or a series in it, that is a copy of another. Reads headers, and whole images
/// only where two files are equally long.
///
/// Equal bytes alone are no fault: without noise, as in the virtual rig, a camera that sees none of a
/// projector's light takes equal images all the time, and one that sees a half of it sees some patterns as
/// white. They are a fault where the group of an image (with its inverse, with the steps of its wave) no
/// longer adds up to white and black.
Status check_images(const CaptureSet& captures);

}  // namespace limn::calib
