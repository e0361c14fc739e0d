#pragma once

#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "session/frame_input.h"

namespace limn::session {

/// Keeps track of the guests whose tablets see markers, and of the positions of the tablets that the
/// viewpoint depends on.
class TabletRegistry {
 public:
  /// `p_eye_world`: the tablet's position; nullopt: its window is closed. `goes_by_it`: whether the viewpoint
  /// depends on this guest. True: places() has changed.
  bool note(const std::string& guest,
            const std::optional<Eigen::Vector3d>& p_eye_world,
            bool goes_by_it,
            Stamp at);

  /// Guests whose tablet views have seen markers and are open.
  const std::set<std::string>& windows() const { return windows_; }
  /// One per guest that the viewpoint depends on.
  std::span<const TabletViewpoint> places() const { return places_; }

 private:
  std::set<std::string> windows_;
  std::vector<TabletViewpoint> places_;
};

}  // namespace limn::session
