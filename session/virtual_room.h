#pragma once

#include "core/result.h"
#include "core/rig.h"
#include "scene/scene.h"
#include "sim/world.h"

namespace limn::session {

/// A virtual room for a rig and a scene, for sessions without connected devices. The rig's own devices stand
/// as they were calibrated (with ordinary noise, blur and gamma). The prototype stands where their optical
/// axes meet, facing camera 0, and carries the slots' markers. World frame: the rig's. Error: a rig without
/// cameras or projectors, a scene without a prototype.
Result<sim::World> room_for(const Rig& rig, const scene::Scene& scene);

}  // namespace limn::session
