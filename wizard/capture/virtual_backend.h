#pragma once

#include "core/image_writer.h"
#include "sim/virtual_rig.h"
#include "wizard/capture/backend.h"
#include "wizard/capture/capture_plan.h"

namespace limn::wizard {

/// A virtual rig (with grab_waits_for_light off) as the wizard's backend: the board is at once where the
/// plan puts it. All three arguments must outlive the result; images go to `writer`.
WizardBackend virtual_backend(const Plan& plan, sim::VirtualRig* rig, ImageWriter* writer);

}  // namespace limn::wizard
