#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/judge/assess.h"
#include "core/rig.h"

namespace limn::apps {

/// What the captures up to one pose are worth.
struct PoseJudged {
  std::string pose;      ///< its name
  bool before = false;   ///< it was captured by an earlier run
  double capture_s = 0;  ///< of the cameras' clock, all projectors
  /// None: no solution comes of these poses yet, and `unsolved` says why.
  std::optional<calib::Assessment> assessment;
  std::string unsolved;
  std::optional<Rig> rig = {};  ///< of these poses, before models are chosen; world: camera 0
  std::string more_helps;       ///< why more poses help; empty: they are enough
};

/// The largest of its projectors' predicted errors.
double predicted_mm(const calib::Assessment& assessment);

/// Why more poses help after the last of `poses`, in a few words; empty when they are enough: the rig is good
/// without a fault that only more poses cure, and the predicted error is a quarter of a millimetre at most
/// or, with as many poses as the report asks for, fell by less than a twentieth over the last two.
std::string more_helps(const std::vector<PoseJudged>& poses);

}  // namespace limn::apps
