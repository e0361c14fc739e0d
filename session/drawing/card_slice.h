#pragma once

#include <cstddef>
#include <vector>

#include "core/pose.h"
#include "projector/overlays/overlays.h"
#include "scene/posed_scene.h"

namespace limn::session {

/// The slice of the section's volumes on the card that carries the section's marker, as signs: `projector`
/// paints it, and the other `projectors - 1` leave the card dark, so that only one of them is seen on it. The
/// card's middle is the origin of its frame, x right, y down; its size is Section::card_size_m. Where several
/// volumes are, the first is shown; outside of all the card is dark. Signs are small, so that a lens's
/// distortion does not bend them. Empty: no card, no volume, or no prototype (signs lie in its frame).
std::vector<projector::Overlay> card_overlays(const scene::Scene& scene,
                                              const scene::PosedScene& posed,
                                              const Pose& world_from_card,
                                              std::size_t projector,
                                              std::size_t projectors);

}  // namespace limn::session
