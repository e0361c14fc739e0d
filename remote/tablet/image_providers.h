#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "remote/tablet/tablet_view.h"

namespace limn::remote {

/// Who draws images for guests: the live composite, and the window into a tablet's own images. They
/// return at once and answer every call exactly once, on another thread, at the latest when these functions
/// are destroyed. All may be empty: there are none.
struct ImageProviders {
  using Seen = TabletView::Seen;
  using Answer = std::function<void(Seen)>;
  std::function<void(const apps::Session&)> know;  ///< at every image of the session, on its thread
  std::function<void(const TabletView::Window&, std::vector<std::uint8_t> jpeg, Answer)> look;
  std::function<void(Answer)> room;
};

/// An onlooker's, which lives as long as they do.
inline ImageProviders image_providers(std::unique_ptr<TabletView> tablet_view) {
  const std::shared_ptr<TabletView> shared = std::move(tablet_view);
  return {
      [shared](const apps::Session& session) { shared->know(session); },
      [shared](const TabletView::Window& window, std::vector<std::uint8_t> jpeg,
               ImageProviders::Answer answer) { shared->look(window, std::move(jpeg), std::move(answer)); },
      [shared](ImageProviders::Answer answer) { shared->room(std::move(answer)); }};
}

}  // namespace limn::remote
