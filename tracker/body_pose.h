#pragma once

#include <optional>
#include <span>

#include "core/frame.h"
#include "core/marker.h"
#include "core/track.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {

/// The pose of a body from its markers in the images of one or several cameras at one moment, without
/// history: the likeliest minimum of the corners' reprojection error (body_correspondences.h: minima),
/// weighted by the corners' covariance, with a Huber loss. nullopt when none of the body's markers gives a
/// pose.
std::optional<Track> world_from_body(const Body& body, std::span<const View> views, Stamp captured_at);

}  // namespace limn::tracker
