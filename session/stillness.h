#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "core/pose.h"
#include "core/track.h"
#include "scene/part_boxes.h"
#include "scene/posed_scene.h"

namespace limn::session {

// The measured pose of a prototype that stands still jitters with the noise of its markers, and all that was
// computed for its surface would be computed again for every frame. Two rules hold the pose. They have
// different limits because their errors have different effects:
//
// keep_still() and keep_parts_still() are for projected light. The projectors do not move with the prototype,
// so a held pose displaces the light. This error must stay invisible: below an eighth of a projector's pixel.
//
// steadied() is for images that are drawn over a camera's or a tablet's own image. It moves all bodies and,
// by its result, the camera together, so nothing is displaced, and the limit may be as large as the jitter.

/// Whether a body's pose has changed by more than a still body's jitter (0.5 mm, 1 mrad).
bool is_elsewhere(const Pose& before, const Pose& now);

/// Keeps the prototype at its last shown pose (nullopt: it was not shown) while no corner of its box
/// (prototype frame) would move by 0.1 mm or more.
void keep_still(const std::optional<Pose>& shown, const Eigen::AlignedBox3d& box, std::vector<Track>* tracks);

/// Keeps parts at their last shown poses while the prototype is where it was shown and no corner of the
/// part's box would move by 0.1 mm or more. Without this rule the images of a scene at rest were drawn again
/// for every frame.
void keep_parts_still(const scene::PosedScene& shown,
                      const scene::PartBoxes& boxes,
                      scene::PosedScene* posed);

/// Keeps the plane that cuts the parts where it was shown while it would move by less than 0.1 mm within
/// 0.5 m of a point of the world, the middle of what is shown.
void keep_cut_still(const scene::PosedScene& shown,
                    const Eigen::Vector3d& p_middle,
                    scene::PosedScene* posed);

/// Moves all bodies together so that the prototype is exactly at `held`. If the prototype has really moved
/// (is_elsewhere), its new pose is held from now on. Returns turned_from_world, the motion that was applied.
Pose steadied(std::optional<Pose>* held, std::vector<Track>* tracks);

}  // namespace limn::session
