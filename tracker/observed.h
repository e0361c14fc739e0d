#pragma once

#include <span>
#include <vector>

#include "core/frame.h"
#include "core/imager.h"
#include "core/marker.h"
#include "core/track.h"
#include "tracker/detection.h"

namespace limn::tracker {

/// Where every body is that one camera sees, from its picture's detections. `camera.imager_from_world` places
/// the camera. Bodies without a pose are absent.
std::vector<Track> observed(std::span<const Body> bodies,
                            std::span<const Detection> detections,
                            const Imager& camera,
                            Stamp captured_at);

}  // namespace limn::tracker
