#pragma once

#include <span>
#include <vector>

#include "tracker/balls/constellation_pose.h"
#include "tracker/body_filter.h"

namespace limn::tracker {

/// The filter's step for constellations, as observed() of body_filter.h is for bodies with markers: `known`
/// (the result of the step before, empty at first), updated by the balls in the images of one moment from all
/// cameras that took one. The up to four poses of three balls are the filter's branches. What earlier images
/// lead to expect also helps to say which balls are whose.
std::vector<BodyFilter> observed(std::span<const BodyFilter> known,
                                 std::span<const Constellation> constellations,
                                 std::span<const BallView> views,
                                 Stamp captured_at,
                                 const MotionModel& model = {});

}  // namespace limn::tracker
