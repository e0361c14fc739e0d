#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/judge/assess.h"
#include "core/rig.h"

namespace limn::wizard {

/// Quality of the calibration from all captures up to one pose.
struct PoseJudged {
  std::string pose;      ///< name of the pose
  bool before = false;   ///< captured by an earlier run
  double capture_s = 0;  ///< duration of the capture with all projectors, s on the cameras' clock
  /// None: these poses give no solution yet, and `unsolved` says why.
  std::optional<calib::Assessment> assessment;
  std::string unsolved;
  std::optional<Rig> rig = {};  ///< solved before lens models are selected; world: camera 0
  std::string more_helps;       ///< why more poses help; empty: these are enough
};

/// The largest predicted error of all projectors, mm.
double predicted_mm(const calib::Assessment& assessment);

/// Why more poses after the last of `poses` help, in a few words; empty if they are enough. They are enough
/// when the rig is good, has no fault that only more poses cure, and the predicted error either is at most
/// 0.25 mm (calib::k_fine_mm) or has fallen by less than a twentieth over the last two poses; the latter
/// counts only with as many poses as the report asks for.
std::string more_helps(const std::vector<PoseJudged>& poses);

}  // namespace limn::wizard
