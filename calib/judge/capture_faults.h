#pragma once

#include <vector>

#include "calib/judge/faults.h"
#include "calib/observations.h"

namespace limn::calib {

/// Faults that the images and their labels show without any solution, so that a solve that fails can say
/// why:
/// - wrong_display: a projector's patterns light nothing, or what another projector's patterns light;
/// - mirrored_projection: labels run against the camera's pixels, which no mirror-free optics do;
/// - keystone_or_scaling: fine stripes and their inverses do not add up to white and black, because
///   something between the pattern and the panel interpolates grey values at their edges;
/// - exposure_drift, projector_gamma, moved_during_capture, defocus, ambient_light, saturated,
///   repeated_pictures: from the series' health (calib/code/capture_quality.h).
std::vector<Fault> capture_faults(const Observed& observed);

/// Where no solution comes of the captures: these and, roughly from the corners alone,
/// wrong_camera_resolution.
std::vector<Fault> unsolved_faults(const Observed& observed);

}  // namespace limn::calib
