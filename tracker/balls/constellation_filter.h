#pragma once

#include <span>
#include <vector>

#include "core/enum_names.h"
#include "tracker/balls/constellation_pose.h"
#include "tracker/body_filter.h"

namespace limn::tracker {

/// How a new image's pose of three balls in one camera is computed.
enum class TriplePose {
  refined,  ///< from the balls' centres, weighted by their covariance
  triangle  ///< by the 2011 paper's triangle (triangle_pose.h), from the balls' places on their rays
};
/// Their names for users.
inline constexpr EnumNames<TriplePose, 2> k_triple_poses{{"refined", "triangle"}};

/// The filter's step for constellations, as observed() of body_filter.h is for bodies with markers: `known`
/// (the result of the step before, empty at first), updated by the balls in the images of one moment from all
/// cameras that took one. The up to four poses of three balls are the filter's branches. What earlier images
/// lead to expect also helps to say which balls are whose. With TriplePose::triangle the newest fix of three
/// balls in one camera, which Prediction::hold and ::linear use, is the paper's; which of the up to four
/// poses it is comes from the filter.
std::vector<BodyFilter> observed(std::span<const BodyFilter> known,
                                 std::span<const Constellation> constellations,
                                 std::span<const BallView> views,
                                 Stamp captured_at,
                                 const MotionModel& model = {},
                                 TriplePose triple_pose = TriplePose::refined);

}  // namespace limn::tracker
