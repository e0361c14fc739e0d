#pragma once

#include <vector>

#include "core/result.h"
#include "core/rig.h"
#include "scene/posed_scene.h"
#include "sim/world.h"
#include "validate/demo_page.h"

namespace limn::validate {

/// What the painting of the demo needs.
struct DemoPainting {
  const scene::Scene* scene = nullptr;
  const Rig* rig = nullptr;           ///< As calibrated.
  const sim::World* world = nullptr;  ///< The truth, in its usual light.
  scene::PosedScene posed;            ///< As tracked.
};

/// Photographs of the door in a dim room, before and after it is painted in light with its first finish,
/// which mirrors the picture of a studio, with the parts on it. Needs a current GL context.
Result<std::vector<DemoImage>> painted_images(const DemoPainting& painting);

}  // namespace limn::validate
