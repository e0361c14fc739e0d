#pragma once

#include <vector>

#include "core/marker.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::remote {

/// The bodies of a scene that carry square markers, with the markers that people have paired with its slots.
std::vector<Body> square_bodies(const scene::Scene& scene, const scene::ShowState& show_state);

}  // namespace limn::remote
