#pragma once

#include "core/result.h"
#include "core/rig.h"
#include "scene/scene.h"
#include "sim/world.h"

namespace limn::apps {

/// A virtual room for a rig and a scene, for sessions with nothing plugged in: the rig's own devices as they
/// were calibrated (with ordinary noise, blur and gamma), the prototype where their lines of sight meet,
/// facing camera 0, the slots' markers on it. World frame: the rig's. Error: a rig without cameras or
/// projectors, a scene without a prototype.
Result<sim::World> room_for(const Rig& rig, const scene::Scene& scene);

}  // namespace limn::apps
