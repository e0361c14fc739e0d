#pragma once

#include <vector>

#include "calib/judge/scale_bar.h"
#include "core/rig.h"

namespace limn::wizard {

/// The scale bars' markers as the tracker finds them, and their boards where all four outermost corners are
/// seen, for every pose and camera: each marker in the white image of the first projector that shows it.
/// Errors: an unknown family; a second board whose markers are those of the first.
Result<std::vector<calib::DetectedMark>> scale_bar_marks(const calib::CaptureSet& captures,
                                                         const Rig& rig,
                                                         const std::vector<calib::ScaleBar>& lengths);

/// The scale bars of capture.json and of the command line.
Result<std::vector<calib::ScaleBar>> scale_bar_lengths(const calib::CaptureSet& captures,
                                                       const std::vector<std::string>& options);

}  // namespace limn::wizard
