#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/foreign_pose.h"
#include "core/result.h"

namespace limn::exchange {

/// Limn's own form of poses in a datagram (docs/trackers.md): one JSON object, or an array of them:
/// {"tracker": NAME, "time_s": T, "poses": [{"name": NAME, "position_m": [x, y, z], "rotation_wxyz": [w, x,
/// y, z], "stddev_mm": S, "stddev_deg": D, "lost": true}]}. Only `poses` and `name` are always needed; a pose
/// that is not lost needs `position_m`. Unknown keys are ignored. Error: other bytes, a missing key, numbers
/// that are not finite, nesting deeper than the form has, too many poses.
Result<std::vector<ForeignPose>> poses_of_json(std::string_view datagram);

/// The poses as one object of this form; `time_s` is that of the first pose, where it has one.
std::string json_of_poses(const std::string& tracker, std::span<const ForeignPose> poses);

}  // namespace limn::exchange
