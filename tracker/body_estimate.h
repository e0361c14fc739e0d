#pragma once

#include <span>
#include <vector>

#include "core/frame.h"
#include "core/marker.h"
#include "core/track.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {

/// Where every body is by one moment's images of all cameras alone, without history (body_motion.h has
/// one). A view's camera is placed by its `imager_from_world`. Bodies without a pose are absent.
std::vector<Track> observed(std::span<const Body> bodies, std::span<const View> views, Stamp captured_at);

}  // namespace limn::tracker
