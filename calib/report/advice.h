#pragma once

#include <string>
#include <vector>

#include "calib/judge/assess.h"
#include "calib/observations.h"
#include "calib/solve.h"

namespace limn::calib {

/// A calibration's worth in plain words.
struct Explanation {
  /// "usable: predicted error 1.4 mm on projector1 (1.9 mm at worst, 1.60 m from camera0, …); …", then why it
  /// is not better, if it is not.
  std::string verdict;
  /// What to do, a sentence each, most useful first: "projector1: add poses near its left edge." Empty when
  /// nothing would help much.
  std::vector<std::string> advice;
};

/// Whether so many poses are enough to judge a rig by: eight, or any number where it is good and its
/// predicted error k_fine_mm at most. (Five tilted poses of the virtual rigs put light within 0.02 mm of the
/// truth, 95 %, and nine within 0.01.)
bool rests_on_enough_poses(const Assessment& assessment, int poses);

/// From the data alone: where the imagers' images are bare, how the boards were tilted and how far away,
/// where the predicted error grows, what the normalised residuals and the epipolar residual say.
Explanation explain(const Observed& observed, const Solution& solution, const Assessment& assessment);

}  // namespace limn::calib
