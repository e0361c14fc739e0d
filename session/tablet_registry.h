#pragma once

#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "session/frame_input.h"

namespace limn::apps {

/// Which guests' tablets see markers, and where those look from that light goes by.
class TabletRegistry {
 public:
  /// `p_eye_world`: nullopt: the window is closed. `goes_by_it`: whether light goes by this guest's eye.
  /// True: what places() says has changed.
  bool note(const std::string& guest,
            const std::optional<Eigen::Vector3d>& p_eye_world,
            bool goes_by_it,
            Stamp at);

  /// Guests whose windows have seen markers and are open.
  const std::set<std::string>& windows() const { return windows_; }
  /// One a guest that light goes by.
  std::span<const TabletViewpoint> places() const { return places_; }

 private:
  std::set<std::string> windows_;
  std::vector<TabletViewpoint> places_;
};

}  // namespace limn::apps
