#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/board/board_finder.h"
#include "calib/capture.h"
#include "core/frame.h"
#include "core/result.h"
#include "wizard/capture/display_latency.h"

namespace limn::wizard {

/// The devices as the wizard uses them: functions, so that virtual and real rigs work alike.
struct WizardBackend {
  /// Called during the wait for the board with each camera image and the corners found in it; may be empty.
  using OnImage = std::function<void(int camera, const cv::Mat&, const std::vector<calib::BoardCorner>&)>;
  /// Returns when the board is in place for this pose, and still.
  std::function<Status(int pose, const OnImage& on_image)> wait_for_board;
  calib::CaptureBackend capture;
  std::function<Status()> wait_for_files;  ///< returns when all stored images are on the disk
  std::function<Stamp()> now;              ///< the cameras' clock
  /// Returns when the board is gone and the prototype stands still; false: a person skipped it. Empty: there
  /// is no prototype.
  std::function<Result<bool>(const OnImage& on_image)> wait_for_prototype = nullptr;
  /// Every projector shows its image; the next grab sees them.
  std::function<Status(const std::vector<cv::Mat>&)> show_all = nullptr;
  /// One projector and one camera for a latency measurement; the other projectors are dark.
  std::function<FlashDevices(int projector, int camera)> flashes;
  /// Sets the time from show() until an image is on the surface. Before the first call it is the longest that
  /// can be measured (FlashOptions::limit_s).
  std::function<void(int projector, double seconds)> use_latency;
};

}  // namespace limn::wizard
