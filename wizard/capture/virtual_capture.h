#pragma once

#include <filesystem>
#include <vector>

#include "calib/capture.h"
#include "calib/capture_set.h"
#include "core/image_writer.h"
#include "core/result.h"
#include "sim/virtual_rig.h"
#include "wizard/capture/capture_plan.h"

namespace limn::apps {

/// The board as a thing in the world, called "board".
sim::Object board_object(const calib::Board& board, const Pose& world_from_board);

/// The captures folder that a plan makes of this rig, still without poses.
Result<calib::CaptureSet> planned(const Plan& plan,
                                  const sim::VirtualRig& rig,
                                  const std::filesystem::path& out);

/// The rig's devices as calib asks for them; images go to `writer`.
calib::CaptureBackend stage_of(sim::VirtualRig* rig,
                               ImageWriter* writer,
                               calib::ReportProgress report_progress);

/// Captures the response images of whatever stands before the rig.
Status capture_lit(const calib::CaptureSet& captures, sim::VirtualRig* rig);

/// Captures every pose of the plan with the board in a virtual rig, whose prototype is put away meanwhile.
Status capture_virtually(const Plan& plan, sim::VirtualRig* rig, const std::filesystem::path& out);

/// Captures the world's prototype itself, standing at each of the places in turn, without a board: scene
/// captures (limn scan).
Status capture_prototype(const Plan& plan,
                         const std::vector<Pose>& world_from_prototype,
                         sim::VirtualRig* rig,
                         const std::filesystem::path& out);

}  // namespace limn::apps
