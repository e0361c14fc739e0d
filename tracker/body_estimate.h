#pragma once

#include <span>
#include <vector>

#include "core/frame.h"
#include "core/marker.h"
#include "core/track.h"
#include "tracker/body_correspondences.h"

namespace limn::tracker {

/// The pose of every body from one moment's images of all cameras, without history (body_filter.h uses
/// history). A view's camera is placed by its `imager_from_world`. Bodies without a pose are absent.
std::vector<Track> observed(std::span<const Body> bodies, std::span<const View> views, Stamp captured_at);

}  // namespace limn::tracker
