#pragma once

#include <atomic>

#include "core/result.h"
#include "session/frame_loop.h"
#include "session/script.h"
#include "sim/virtual_rig.h"

namespace limn::apps {

/// The virtual rig's delays: 60 ms from a camera's exposure to the light of what was made of it.
constexpr double k_virtual_camera_s = 0.020, k_virtual_display_s = 0.040;

/// Plays a session on a virtual rig, on its clock: nothing sleeps, every run is the same. Each frame is made
/// of one exposure. Ends at `end_s` of the clock, with `is_ended`, or when a client ends it.
Status play_virtually(double end_s,
                      const std::atomic<bool>& is_ended,
                      sim::VirtualRig* rig,
                      ScriptedRoom* room,
                      const SessionParts& parts);

}  // namespace limn::apps
