#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/board/board_finder.h"
#include "calib/capture.h"
#include "core/frame.h"
#include "core/result.h"
#include "wizard/capture/display_latency.h"

namespace limn::apps {

/// What the wizard needs from outside: functions, so that a virtual rig and devices in a room are alike.
struct Surroundings {
  /// Told of the board in a camera's image while it is waited for; may be empty.
  using Seen = std::function<void(int camera, const cv::Mat&, const std::vector<calib::BoardCorner>&)>;
  /// Returns when the board is where this pose wants it, and still.
  std::function<Status(int pose, const Seen& seen)> hold;
  calib::CaptureBackend stage;
  std::function<Status()> written;  ///< returns when every image that was stored is on the disk
  std::function<Stamp()> now;       ///< of the cameras' clock
  /// Returns when the board is gone and the prototype stands still; false: a person skipped it. Empty: there
  /// is no prototype.
  std::function<Result<bool>(const Seen& seen)> stand = nullptr;
  /// All projectors show an image each, which is visible to the next grab.
  std::function<Status(const std::vector<cv::Mat>&)> paint = nullptr;
  /// One projector and one camera, the others dark.
  std::function<FlashStage(int projector, int camera)> flashes;
  /// From now on an image is on the surface so long after it was shown; before, the longest that is
  /// measured.
  std::function<void(int projector, double seconds)> use_latency;
};

}  // namespace limn::apps
