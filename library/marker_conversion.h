#pragma once

#include "limn/markers.h"
#include "tracker/detection.h"

namespace limn::LIMN_VERSIONED {

/// What body poses need of a marker. Error: a corner's covariance that is none.
limn::tracker::Detection detection_of(const Marker& marker);

}  // namespace limn::LIMN_VERSIONED
