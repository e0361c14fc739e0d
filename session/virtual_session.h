#pragma once

#include <atomic>

#include "core/result.h"
#include "session/frame_loop.h"
#include "session/script.h"
#include "sim/virtual_rig.h"

namespace limn::session {

/// The virtual rig's delays: together 60 ms from a camera's exposure to the projected light that is made from
/// it.
constexpr double k_virtual_camera_s = 0.020, k_virtual_display_s = 0.040;

/// Runs a session on a virtual rig, on its clock: nothing sleeps, and every run is the same. Each frame is
/// made of one exposure. Ends at `end_s` of the clock, when `is_ended` is set, or when a client ends it.
Status play_virtually(double end_s,
                      const std::atomic<bool>& is_ended,
                      sim::VirtualRig* rig,
                      ScriptedRoom* room,
                      const SessionParts& parts);

}  // namespace limn::session
