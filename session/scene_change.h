#pragma once

#include "core/result.h"
#include "scene/scene.h"
#include "scene/show_state.h"
#include "session/scene_watch.h"

namespace limn::session {

/// Decides whether a session can continue with a changed scene, and what it shows then. All functions are
/// pure.

/// Whether a session with the scene `now` can continue with `next`: both have the same markers on the same
/// bodies, and the same controls. Error: what is different, and what to do.
Status check_same_markers(const scene::Scene& now, const scene::Scene& next);

/// Whether the prototypes of both have the same mesh.
bool has_same_prototype(const scene::Scene& now, const scene::Scene& next);

/// Gives each variant that `now` has and that can no longer be loaded its old mesh, and moves it from
/// `loaded`'s list to the result. Slots that then have no variant are left out.
std::vector<scene::SkippedVariant> keep_old_variants(const scene::Scene& now, LoadedScene* loaded);

/// The show state for the scene `next`: a new variant of a slot is shown at once, and a variant that is gone
/// is replaced by the slot's first.
scene::ShowState with_variants_of(const scene::Scene& next,
                                  const scene::Scene& now,
                                  scene::ShowState show_state);

}  // namespace limn::session
