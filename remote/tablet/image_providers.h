#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "remote/tablet/camera_locator.h"
#include "remote/tablet/tablet_view.h"

namespace limn::remote {

/// The functions that draw images for guests: the live composite, and the window into a tablet's own images.
/// They return at once and call back exactly once, on another thread, at the latest when these functions are
/// destroyed. An empty function says that there are no such images.
struct ImageProviders {
  /// Called after every frame of the session, on its thread.
  std::function<void(const session::Session&)> update_session;
  std::function<void(const TabletWindow&, std::vector<std::uint8_t> jpeg, ImageCallback)> draw_window;
  std::function<void(ImageCallback)> draw_room;
  /// Finds the camera of glasses: CameraLocator::locate().
  std::function<void(
      std::uint64_t camera, const StatedLens&, std::vector<std::uint8_t> jpeg, LocatedCallback)>
      locate_camera;
};

/// The functions of a tablet view and of a locator, which live as long as they do. Without a locator the
/// cameras of glasses are not used.
inline ImageProviders image_providers(std::unique_ptr<TabletView> tablet_view,
                                      std::unique_ptr<CameraLocator> locator = nullptr) {
  const std::shared_ptr<TabletView> shared = std::move(tablet_view);
  const std::shared_ptr<CameraLocator> cameras = std::move(locator);
  ImageProviders out{
      [shared, cameras](const session::Session& session) {
        shared->update_session(session);
        if (cameras) cameras->update_session(session);
      },
      [shared](const TabletWindow& window, std::vector<std::uint8_t> jpeg, ImageCallback answer) {
        shared->draw_window(window, std::move(jpeg), std::move(answer));
      },
      [shared](ImageCallback answer) { shared->draw_room(std::move(answer)); },
      {}};
  if (cameras)
    out.locate_camera = [cameras](std::uint64_t camera, const StatedLens& lens,
                                  std::vector<std::uint8_t> jpeg, LocatedCallback answer) {
      cameras->locate(camera, lens, std::move(jpeg), std::move(answer));
    };
  return out;
}

}  // namespace limn::remote
