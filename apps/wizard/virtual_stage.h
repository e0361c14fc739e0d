#pragma once

#include "apps/picture_writer.h"
#include "apps/plan.h"
#include "apps/wizard/surroundings.h"
#include "sim/virtual_rig.h"

namespace limn::apps {

/// A virtual rig, one that does not wait for light by itself, as the wizard's surroundings: the board is
/// where the plan wants it at once. All three must stay as long as they are used; pictures go to `writer`.
Surroundings virtual_surroundings(const Plan& plan, sim::VirtualRig* rig, PictureWriter* writer);

}  // namespace limn::apps
