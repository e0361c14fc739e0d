#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/pose.h"
#include "core/track.h"

namespace limn::apps {

// A prototype that stands still trembles by what its markers are measured to, and what was found out about
// its surface would have to be found anew for every frame. Two rules keep it where it was. There are two
// because they cost different things:
//
// keep_still() is for light. The projectors do not move with the prototype, so all that is held back is an
// error of the light: it must stay below what anybody sees, an eighth of a projector's pixel.
//
// steadied() is for images that are drawn over a camera's or a tablet's own image. It turns all bodies and,
// by its result, the camera together, so nothing is displaced and the limit may be as wide as measurements
// tremble.

/// Whether a still body's pose has changed by more than it trembles (0.5 mm, 1 mrad).
bool is_elsewhere(const Pose& before, const Pose& now);

/// Leaves the prototype in the pose in which it was shown (nullopt: it was not) while no corner of its box
/// (its own frame) moves by 0.1 mm.
void keep_still(const std::optional<Pose>& shown, const Eigen::AlignedBox3d& box, std::vector<Track>* tracks);

/// Turns all bodies together so that the prototype stands exactly where `held` has it, unless it is
/// elsewhere, where it is held from now on. Returns turned_from_world.
Pose steadied(std::optional<Pose>* held, std::vector<Track>* tracks);

}  // namespace limn::apps
