#pragma once

#include <atomic>
#include <vector>

#include "core/result.h"
#include "session/frame_loop.h"
#include "session/pace_control.h"
#include "session/requests/script.h"
#include "sim/virtual_rig.h"

namespace limn::session {

/// The virtual rig's delays: together 60 ms from a camera's exposure to the projected light that is made from
/// it.
constexpr double k_virtual_camera_s = 0.020, k_virtual_display_s = 0.040;

/// A session whose clock runs as a clock on the wall. A slow machine leaves frames out and lowers its effort,
/// a fast one waits.
struct RealTime {
  Rig whole;  ///< the virtual rig with its whole resolution
  double frame_period_s = 1 / 30.0;
  std::vector<Effort> efforts;  ///< that may be chosen (efforts_for)
  std::size_t first = 0;        ///< the index of the one with which the session begins
};

sim::VirtualRigOptions virtual_rig_options(double frame_period_s);

/// Runs a session on a virtual rig, on its clock. Each frame is made of one exposure. Ends at `end_s` of the
/// clock, when `is_ended` is set, or when a client ends it. `real_time`: null, and the clock goes from frame
/// to frame as fast as the machine can: nothing sleeps, and every run is the same.
Status play_virtually(double end_s,
                      const RealTime* real_time,
                      const std::atomic<bool>& is_ended,
                      sim::VirtualRig* rig,
                      ScriptedRoom* room,
                      const SessionParts& parts);

/// Seconds that this machine needs for one frame of a session in this world, measured by playing some. The
/// world's rig and the setup's have the same resolution. Needs no OpenGL context and leaves none.
Result<double> measure_frame_s(const sim::World& world, SessionSetup setup);

}  // namespace limn::session
