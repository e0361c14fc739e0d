#pragma once

#include "core/image_writer.h"
#include "sim/virtual_rig.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/capture_plan.h"

namespace limn::apps {

/// A virtual rig, one that does not wait for light by itself, as the wizard's surroundings: the board is
/// where the plan wants it at once. All three must stay as long as they are used; images go to `writer`.
Surroundings virtual_backend(const Plan& plan, sim::VirtualRig* rig, ImageWriter* writer);

}  // namespace limn::apps
