#pragma once

#include <filesystem>
#include <string>

#include "calib/capture_set.h"
#include "core/result.h"

namespace limn::wizard {

/// The part of a plan that determines what a virtual rig captures (limn.captured_plan/1): the plan and its
/// world, without the path from one to the other. Error: a file that cannot be read.
Result<std::string> captured_plan(const std::filesystem::path& plan, const std::filesystem::path& world);

/// The same for real devices (limn.captured_plan/1): the board, the code and the devices' sizes.
std::string captured_plan(const std::string& board,
                          calib::PatternCode code,
                          const calib::CaptureSet& captures);

/// Creates the captures folder for this plan, or accepts the one that was made with it; the plan may have got
/// more poses at its end. Error: the folder holds captures of another plan; the message says what differs.
Status open_captures(const calib::CaptureSet& captures, const std::string& plan_json);

/// One pose of the captures with the paths of all its images, whether they exist or not.
calib::CapturedPose files_of(const calib::CaptureSet& captures, int pose);

/// Whether all of a pose's images are on the disk. Files are written completely or not at all; a power cut
/// can leave an empty file, which counts as missing.
bool is_complete(const calib::CapturedPose& pose);

/// Removes the images of an interrupted pose: the board may have moved since, so they cannot be used.
void remove_images(const calib::CapturedPose& pose);

}  // namespace limn::wizard
