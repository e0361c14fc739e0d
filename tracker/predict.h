#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/track.h"
#include "tracker/body_filter.h"

namespace limn::tracker {

/// How a pose is carried from the image that showed it to a later moment.
enum class Prediction {
  hold,     ///< as the newest image alone said
  linear,   ///< onwards as from the last image but one to the last (the 2011 paper's extrapolation)
  filtered  ///< by the filter's position, velocity and acceleration
};

/// hold, linear, filtered: what people call them, in the order of Prediction.
const std::vector<std::string>& prediction_names();
/// nullopt for another word.
std::optional<Prediction> prediction_of(const std::string& name);

/// Every known body as a track at a moment, not before its measured_at (earlier moments get the pose of
/// then). The covariance grows with the time since. A body in the newest image is `measured`; one that is
/// not is `extrapolated`; one unseen for longer than lost_after_s() before `at` is `lost` and stays where it
/// was last measured. With `decided_at` (not after `at`) that is judged then: what is drawn for a moment to
/// come is not lost because drawing takes long. Pure: the clock is the caller's.
std::vector<Track> predicted(std::span<const BodyFilter> known,
                             Stamp at,
                             Prediction how = Prediction::filtered,
                             const MotionModel& model = {},
                             std::optional<Stamp> decided_at = std::nullopt);

}  // namespace limn::tracker
