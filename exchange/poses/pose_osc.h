#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/foreign_pose.h"
#include "core/result.h"

namespace limn::exchange {

/// What senders of OSC do differently.
struct PoseOscOptions {
  double unit_m = 1e-3;             ///< the length of one unit of positions; 1e-3 as Limn sends them
  bool has_real_part_last = false;  ///< quaternions are x, y, z, w
};

/// Decodes poses of a message or bundle of OSC (docs/trackers.md): `/limn/pose NAME x y z qw qx qy qz`,
/// `/limn/lost NAME`; what Limn sends itself (`/limn/state/pose`, `/limn/state/lost`, and
/// `/limn/state/prototype` without a name); `/…/NAME/pose x y z qw qx qy qz` and `/…/NAME/position x y z`
/// of other programs. A further number after a pose is its time in seconds; without it a bundle's time
/// counts. Other addresses give no pose. Error: no OSC, a pose's arguments that do not fit, numbers that are
/// not finite, bundles in bundles in bundles, too many poses.
Result<std::vector<ForeignPose>> poses_of_osc(std::span<const std::uint8_t> datagram,
                                              const PoseOscOptions& options = {});

}  // namespace limn::exchange
