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

/// The window of docs/remote.md: finds where guests' tablets are in the images that they send, and draws
/// the parts into those same images. Has a thread and a GL context of its own, both of low priority: a
/// session does not wait for it. The lens of each device is estimated from the markers while people look
/// round, and kept.
class TabletView {
 public:
  /// `lens_folder` keeps what is known of guests' lenses; made when there is something to keep. Errors: no GL
  /// context, marker families that cannot be loaded, a scene that cannot be drawn.
  static Result<std::unique_ptr<TabletView>> create(const apps::SessionSetup& setup,
                                                    std::filesystem::path lens_folder);
  /// Everybody who still waits is answered first, with nothing.
  ~TabletView();

  /// What the session knows now: call it at every image, on the session's thread. Cheap; the scene is
  /// copied when it is another one.
  void know(const apps::Session& session);

  /// An answer to a guest: the window's JSON of docs/remote.md, and an image, empty where there is none.
  struct Seen {
    std::string json;
    std::vector<std::uint8_t> jpeg;
    std::optional<Eigen::Vector3d> p_eye_world = {};  ///< where the tablet looks from, if that is known
  };

  /// Whose image it is, and what is drawn into it; the session's split is kept.
  struct Window {
    std::string device;      ///< whose lens it has
    std::string guest = {};  ///< as ShowState::viewer calls the one that light shows `view` parts to
    TabletViewMode parts = TabletViewMode::as_screen;
  };

  /// Draws the parts into a guest's image. From any thread; returns at once. The newest image of a device
  /// wins: one that it overtakes is answered with nothing. Every call is answered exactly once, on the
  /// onlooker's thread, which waits for `answer` to return. Images that are no JPEG, too large or damaged
  /// are answered with nothing and why.
  void look(const Window& window, std::vector<std::uint8_t> jpeg, std::function<void(Seen)> answer);

  /// Camera 0's newest image with the parts, as the room's screen shows it, at most 1280 pixels a side; its
  /// JSON is {"why": ""}, or says why there is no image. Otherwise as look().
  void room(std::function<void(Seen)> answer);

 private:
  struct Impl;
  explicit TabletView(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::remote
