#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/enum_names.h"
#include "core/track.h"
#include "tracker/body_filter.h"

namespace limn::tracker {

/// How a pose is extrapolated from the last image to a later moment.
enum class Prediction {
  hold,     ///< the pose from the newest image
  linear,   ///< extrapolated from the last two images' poses, as in the 2011 paper
  filtered  ///< by the filter's position, velocity and acceleration
};

/// Their names for users.
inline constexpr EnumNames<Prediction, 3> k_predictions{{"hold", "linear", "filtered"}};

/// The track of every known body at a moment. A moment before the body's measured_at gets the pose at
/// measured_at. The covariance grows with the time since then. A body in the newest image is `measured`; one
/// that is not in it is `extrapolated`; one unseen for longer than lost_after_s() before `at` is `lost` and
/// stays where it was last measured. `decided_at` (not after `at`), if given, replaces `at` in that
/// comparison: a body drawn for a future moment is not lost because drawing takes long. Pure: it reads no
/// clock.
std::vector<Track> predicted(std::span<const BodyFilter> known,
                             Stamp at,
                             Prediction how = Prediction::filtered,
                             const MotionModel& model = {},
                             std::optional<Stamp> decided_at = std::nullopt);

}  // namespace limn::tracker
