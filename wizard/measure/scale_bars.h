#pragma once

#include <string>
#include <vector>

#include "calib/judge/scale_bar.h"
#include "core/rig.h"

namespace limn::wizard {

/// The scale bars' markers, as marks_of() finds them, and their boards where all four outermost corners are
/// seen. Errors: an unknown family; a second board whose marks are those of the first.
Result<std::vector<calib::DetectedMark>> scale_bar_marks(const calib::CaptureSet& captures,
                                                         const Rig& rig,
                                                         const std::vector<calib::ScaleBar>& lengths);

/// All markers of these families as the tracker finds them, for every pose and camera: each marker in the
/// white image of the first projector that shows it. The board's own markers are left out. `rig`: its lenses
/// are used where it is given. Error: an unknown family.
Result<std::vector<calib::DetectedMark>> marks_of(const calib::CaptureSet& captures,
                                                  const std::vector<std::string>& families,
                                                  const Rig* rig = nullptr);

/// The families of the scale bars' markers.
std::vector<std::string> families_of(const std::vector<calib::ScaleBar>& lengths);

/// The scale bars of capture.json and of the command line.
Result<std::vector<calib::ScaleBar>> scale_bar_lengths(const calib::CaptureSet& captures,
                                                       const std::vector<std::string>& options);

}  // namespace limn::wizard
