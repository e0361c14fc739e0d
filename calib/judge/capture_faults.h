#pragma once

#include <vector>

#include "calib/judge/faults.h"
#include "calib/observations.h"

namespace limn::calib {

/// Faults that the images and their labels show without a solution, so that a solve that fails can say why:
/// - wrong_display: a projector's patterns illuminate nothing, or what another projector's patterns
/// illuminate;
/// - mirrored_projection: labels run against the camera's pixels, which needs a mirror in the light's path;
/// - keystone_or_scaling: fine stripes and their inverses do not add up to white and black, because
///   something between the pattern and the panel interpolates grey values at their edges;
/// - exposure_drift, projector_gamma, moved_during_capture, defocus, ambient_light, saturated,
///   repeated_pictures: from the capture quality of the series (calib/code/capture_quality.h);
/// - shake, flicker: what decoding has measured and taken out (calib/code/shake.h); notes.
std::vector<Fault> capture_faults(const Observed& observed);

/// For captures without a solution: the faults above and wrong_camera_resolution, estimated roughly from the
/// corners alone.
std::vector<Fault> unsolved_faults(const Observed& observed);

}  // namespace limn::calib
