#include "session/tablet_registry.h"

#include <algorithm>

namespace limn::session {

bool TabletRegistry::note(const std::string& guest,
                          const std::optional<Eigen::Vector3d>& p_eye_world,
                          bool goes_by_it,
                          Stamp at) {
  if (p_eye_world)
    windows_.insert(guest);
  else
    windows_.erase(guest);
  const auto known = std::find_if(places_.begin(), places_.end(),
                                  [&](const TabletViewpoint& place) { return place.guest == guest; });
  const bool is_known = known != places_.end();
  if (!goes_by_it || (!p_eye_world && !is_known)) return false;
  if (is_known) places_.erase(known);
  if (p_eye_world) places_.push_back({guest, *p_eye_world, at});
  return true;
}

}  // namespace limn::session
