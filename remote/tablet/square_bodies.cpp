#include "remote/tablet/square_bodies.h"

#include "core/constellation.h"

namespace limn::remote {

std::vector<Body> square_bodies(const scene::Scene& scene, const scene::ShowState& show_state) {
  std::vector<Body> out;
  if (scene.prototype) out.push_back({"prototype", scene.prototype->markers});
  for (std::size_t i = 0; i < scene.slots.size(); ++i) {
    const scene::Slot& slot = scene.slots[i];
    const MarkerName& carrier = scene::slot_marker(scene, show_state, i);
    if (is_constellation(carrier)) continue;  // a tablet finds square markers only
    const double size_m = carrier == slot.marker ? slot.size_m : scene::first_marker_size_m(scene);
    out.push_back({slot.name, {{carrier, size_m, Pose()}}});
  }
  return out;
}

}  // namespace limn::remote
