#pragma once

#include <string>
#include <vector>

#include "calib/judge/assess.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// The explanation of a calibration's quality for people.
struct Explanation {
  /// "usable: predicted error 1.4 mm on projector1 (1.9 mm at worst, 1.60 m from camera0, …); …", then what
  /// keeps the verdict from being better, if anything.
  std::string verdict;
  /// What to do, one sentence each, most useful first: "projector1: add poses near its left edge." Empty when
  /// nothing would help much.
  std::vector<std::string> advice;
};

/// Whether this number of poses is enough to judge a rig: at least eight, or any number where the verdict is
/// good and the predicted error is at most k_fine_mm. (With five tilted poses the virtual rigs put 95 % of
/// the light within 0.02 mm of the truth, with nine within 0.01 mm.)
bool rests_on_enough_poses(const Assessment& assessment, int poses);

/// Derives verdict and advice from the data alone: which regions of the imagers' images have no observations,
/// how the boards were tilted and how far away they were, where the predicted error grows, and the normalised
/// and epipolar residuals. `is_scale_checked`: something besides the board's text says how large the board
/// is; otherwise the verdict's first sentence names that condition.
Explanation explain(const Observed& observed,
                    const Solution& solution,
                    const Assessment& assessment,
                    bool is_scale_checked = true);

}  // namespace limn::calib
