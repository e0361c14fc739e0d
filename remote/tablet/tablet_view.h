#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "remote/tablet/tablet_view_mode.h"
#include "session/recording.h"
#include "session/session.h"

namespace limn::remote {

/// A camera's image with parts drawn into it, or the reason why there is none.
struct CompositeImage {
  std::string json;                ///< The JSON that docs/remote.md describes for the image.
  std::vector<std::uint8_t> jpeg;  ///< Empty: no image.
  std::optional<Eigen::Vector3d> p_viewpoint_world = {};  ///< The tablet's camera; nullopt: not known.
  /// The camera as it saw the prototype: its world is the prototype's frame. nullopt: not known.
  std::optional<Imager> over_prototype = {};
};
using ImageCallback = std::function<void(CompositeImage)>;

/// Whose image a frame is, and what is drawn into it. The session's split is drawn in any case.
struct TabletWindow {
  std::string device;  ///< The device whose lens the image has.
  std::string guest =
      {};  ///< The guest's name, if this window can be the viewer (ShowState::viewer); or empty.
  TabletViewMode parts = TabletViewMode::as_screen;
};

/// The window of docs/remote.md: finds the camera poses of guests' tablets in the images that they send, and
/// draws the parts into those same images. It has a thread and a GL context of its own, both of low priority,
/// so that a session does not wait for it. The lens of each device is estimated from markers over many
/// images, and saved.
class TabletView {
 public:
  /// `lens_folder` keeps the estimates of lenses; it is made when there is something to save. Errors: no GL
  /// context, marker families that cannot be loaded, a scene that cannot be drawn.
  static Result<std::unique_ptr<TabletView>> create(const session::SessionSetup& setup,
                                                    std::filesystem::path lens_folder);
  /// First answers everybody who still waits, without an image.
  ~TabletView();

  /// Copies what is drawn from the session: call it after every frame, on the session's thread. It is cheap;
  /// the scene is copied only when it has changed.
  void update_session(const session::Session& session);

  /// Draws the parts into a guest's image. May be called from any thread and returns at once. Of one device
  /// only the newest image is drawn; one that it replaces is answered without an image. `answer` is called
  /// exactly once, on the view's own thread, which waits for its return. Images that are no JPEG, too large
  /// or damaged are answered without an image, and with the reason.
  void draw_window(const TabletWindow& window, std::vector<std::uint8_t> jpeg, ImageCallback answer);

  /// Draws the parts into camera 0's newest image, as the room's screen shows it, at most 1280 pixels a side.
  /// The JSON is {"why": ""}, or says why there is no image. Otherwise as draw_window().
  void draw_room(ImageCallback answer);

 private:
  struct Impl;
  explicit TabletView(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::remote
