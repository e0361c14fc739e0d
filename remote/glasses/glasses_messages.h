#pragma once

#include <span>
#include <string>
#include <vector>

#include "core/rig.h"
#include "remote/glasses/glasses_registration.h"
#include "scene/posed_scene.h"

namespace limn::remote {

/// The message `glasses` of docs/remote.md: the state, what to do, and the place while it is known. Numbers
/// are rounded, so that the text changes only when the page should draw otherwise. `markers` are all that
/// glasses can have in this scene.
std::string glasses_message(const GlassesRegistration& registration,
                            const std::string& marker,
                            std::span<const std::string> markers);

/// The message `glasses_parts`: where the prototype and the parts are in the world and what the section cuts
/// of them, in at most some 100 bytes a part, and as many again for one that is cut. `number` is that of the
/// scene; with another number the page fetches the meshes again.
std::string glasses_parts_message(const scene::PosedScene& posed, const scene::Scene& scene, int number);

/// `/glasses/light.json`: where each projector is and the outline of its light, as tangents (x / z, y / z in
/// the projector's frame) along the border of its image.
std::string glasses_light_json(const Rig& rig);

}  // namespace limn::remote
