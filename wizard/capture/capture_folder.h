#pragma once

#include <filesystem>
#include <string>

#include "calib/capture_set.h"
#include "core/result.h"

namespace limn::apps {

/// What decides what a virtual rig captures (limn.captured_plan/1): the plan and its world, without the path
/// between them. Error: a file that cannot be read.
Result<std::string> captured_plan(const std::filesystem::path& plan, const std::filesystem::path& world);

/// What decides what devices capture (limn.captured_plan/1): the board, the code and the devices' sizes.
std::string captured_plan(const std::string& board,
                          const std::string& code,
                          const calib::CaptureSet& captures);

/// Makes the captures folder for this plan, or finds that the same plan made it; a plan may have grown at its
/// end. Error: the folder holds captures of another plan; the message says what differs.
Status open_captures(const calib::CaptureSet& captures, const std::string& plan_json);

/// One pose of the captures, with the files that it has or will have.
calib::CapturedPose files_of(const calib::CaptureSet& captures, int pose);

/// Whether all of a pose's images are on the disk. Files are written whole or not at all; an empty one is
/// what a power cut leaves.
bool is_complete(const calib::CapturedPose& pose);

/// Removes what is left of an interrupted pose: the board may stand elsewhere, so nothing of it can be used.
void remove_images(const calib::CapturedPose& pose);

}  // namespace limn::apps
