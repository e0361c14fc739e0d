#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/pose.h"
#include "core/result.h"
#include "session/session.h"

namespace limn::remote {

/// A picture's lens as the browser states it, pixels of the picture; no distortion.
struct StatedLens {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

/// Errors, in words for a guest: sizes of no picture; numbers that are not finite; focal lengths that are no
/// camera's or differ from each other; a centre outside of the picture.
Status check_lens(const StatedLens& lens);

/// Where the camera of a picture was.
struct LocatedCamera {
  bool is_located = false;
  bool is_refused = false;  ///< The picture is wrong; else it shows too little. `why` says which.
  std::string why;
  Pose camera_from_world;
  Matrix6d covariance = Matrix6d::Zero();                                     ///< For the stated lens.
  Eigen::Matrix<double, 6, 3> by_lens = Eigen::Matrix<double, 6, 3>::Zero();  ///< As in pose_by_lens.h.
};
using LocatedCallback = std::function<void(LocatedCamera)>;

/// Finds the cameras of glasses by the scene's markers in their pictures, whose places the session knows. It
/// has a thread of low priority of its own, so that a session does not wait for it.
class CameraLocator {
 public:
  /// Errors: marker families that cannot be loaded.
  static Result<std::unique_ptr<CameraLocator>> create(const session::SessionSetup& setup);
  /// First answers everybody who still waits.
  ~CameraLocator();

  /// Copies what is needed of the session: call it after every frame, on the session's thread. It is cheap.
  void update_session(const session::Session& session);

  /// Finds the camera of a picture. May be called from any thread and returns at once. `camera` is a number
  /// for the camera that it is of; of each only the newest picture is used. `answer` is called exactly once,
  /// on the locator's own thread.
  void locate(std::uint64_t camera,
              const StatedLens& lens,
              std::vector<std::uint8_t> jpeg,
              LocatedCallback answer);

 private:
  struct Impl;
  explicit CameraLocator(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn::remote
