#pragma once

#include <filesystem>
#include <vector>

#include "calib/capture.h"
#include "calib/capture_set.h"
#include "core/image_writer.h"
#include "core/result.h"
#include "sim/virtual_rig.h"
#include "wizard/capture/capture_plan.h"

namespace limn::wizard {

/// The board as an object of the world, named "board".
sim::Object board_object(const calib::Board& board, const Pose& world_from_board);

/// The capture set of a plan for this rig, still without poses.
Result<calib::CaptureSet> plan_virtual_captures(const Plan& plan,
                                                const sim::VirtualRig& rig,
                                                const std::filesystem::path& out);

/// The rig's devices as a capture backend; images go to `writer`.
calib::CaptureBackend capture_backend(sim::VirtualRig* rig,
                                      ImageWriter* writer,
                                      calib::ReportProgress report_progress);

/// Captures the response images of whatever stands in front of the rig.
Status capture_response_images(const calib::CaptureSet& captures, sim::VirtualRig* rig);

/// Captures every pose of the plan with the board in a virtual rig; the prototype is removed meanwhile.
Status capture_virtually(const Plan& plan, sim::VirtualRig* rig, const std::filesystem::path& out);

/// Captures the world's prototype at each of these poses, without a board: scene captures (limn scan).
Status capture_prototype(const Plan& plan,
                         const std::vector<Pose>& world_from_prototype,
                         sim::VirtualRig* rig,
                         const std::filesystem::path& out);

}  // namespace limn::wizard
