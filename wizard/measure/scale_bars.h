#pragma once

#include <vector>

#include "calib/judge/scale_bar.h"
#include "core/rig.h"

namespace limn::apps {

/// The markers of the lengths as the tracker finds them in every camera's white images of every pose; the
/// first projector's that shows one. An unknown family is an error.
Result<std::vector<calib::DetectedMark>> scale_bar_marks(const calib::CaptureSet& captures,
                                                         const Rig& rig,
                                                         const std::vector<calib::ScaleBar>& lengths);

/// The lengths of capture.json and of the command line.
Result<std::vector<calib::ScaleBar>> scale_bar_lengths(const calib::CaptureSet& captures,
                                                       const std::vector<std::string>& options);

}  // namespace limn::apps
