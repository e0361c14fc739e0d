#pragma once

#include <atomic>

#include "session/session_output.h"
#include "session/operator_console.h"
#include "session/osc_port.h"
#include "session/script.h"
#include "session/session.h"
#include "session/perception.h"
#include "session/remote_link.h"
#include "core/result.h"
#include "sim/virtual_rig.h"

namespace limn::apps {

/// The virtual rig's delays: 60 ms from a camera's exposure to the light of what was made of it.
constexpr double k_virtual_camera_s = 0.020, k_virtual_display_s = 0.040;

/// Plays a session on a virtual rig, on its clock: nothing sleeps, every run is the same. In step: expose,
/// watch, paint, show. Ends at `end_s` of the clock, with `is_ended`, or when the operator ends it (`desk`,
/// `osc` and `remote` may be null).
Status play_virtually(double end_s,
                      const std::atomic<bool>& is_ended,
                      sim::VirtualRig* rig,
                      ScriptedRoom* room,
                      Perception* perception,
                      Session* session,
                      SessionOutput* output,
                      OperatorConsole* console,
                      OscPort* osc,
                      RemoteLink* remote);

}  // namespace limn::apps
