#pragma once

#include <span>
#include <vector>

#include "core/marker.h"
#include "core/track.h"
#include "limn/bodies.h"

namespace limn::LIMN_VERSIONED {

/// Errors as of Tracker.
std::vector<limn::Body> rooms_of(std::span<const Body> bodies);
std::vector<Body> public_of(const std::vector<limn::Body>& bodies);
limn::Track room_of(const Track& track);

}  // namespace limn::LIMN_VERSIONED
